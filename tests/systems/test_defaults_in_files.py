"""What a class has by default is what a file has that does not say otherwise, or it is refused."""

import sys
import types

import numpy as np
import odd_systems
import pytest

import wiperjax
from wiperjax.maps.cells.devices import alike
from wiperjax.specs.errors import SpecError
from wiperjax.specs.taken import check_names
from wiperjax.systems.build import build

SCENE = {"run": {"duration": 1.0}, "classes": {"quiet_velocity": 1e-3}}


def scene(name, **tables):
    return wiperjax.parse_scene(SCENE | {"system": f"odd_systems:{name}"} | tables)


def built(name, **tables):
    spec = scene(name, **tables)
    return build(spec, spec.parameters()).system


def test_a_plain_number_with_a_name_of_the_wipers_keeps_its_own_default():
    found, python = built("Pendant"), odd_systems.Pendant()
    for name in ("gravity", "restitution", "support_damping"):
        assert getattr(found, name) == getattr(python, name), name
    with pytest.raises(SpecError, match=r"parameters.restitution: must lie inside \[0, 1\], was 2"):
        scene("Pendant", parameters={"restitution": 2.0})  # range and unit are the wiper's


def test_a_law_made_of_one_of_the_package_stays_itself():
    law = built("OnSofter").friction
    assert type(law) is odd_systems.Softer
    assert (law.static, law.dynamic, law.softening) == (0.9, 0.6, 3.0)
    law = built("OnSofter", parameters={"mu_static": 0.8, "softening": 1.0}).friction
    assert (law.static, law.dynamic, law.softening) == (0.8, 0.6, 1.0)
    assert scene("OnSofter").family.meaning(scene("OnSofter"))["friction"] == "odd_systems:Softer"
    plain = built("OnSofter", parameters={"friction": "coulomb"}).friction
    assert type(plain) is wiperjax.Coulomb


def test_a_law_by_default_keeps_what_is_no_number():
    law = built("OnSwitched", parameters={"static": 0.6}).friction
    assert (law.static, law.falls, law.weights) == (0.6, True, (0.5, 1.5))


def test_a_belt_that_turns_by_default_needs_no_table():
    spec = scene("OnWiping")
    assert spec.belt_kind == "wiping" and spec.thresholds().reversal_window > 0
    belt = build(spec, spec.parameters()).system.belt
    assert (belt.amplitude, belt.frequency) == (0.5, 0.05)


def test_notes_of_a_lip_are_of_the_belt_that_its_class_has():
    """Those of a file without a table [belt] asked for the numbers of a steady one: KeyError."""
    narrow = {"quiet_velocity": 1e-3, "reversal_window": 0.01}
    axes, run = {"lip_length": {"values": [0.006, 0.01]}}, {"transient": 0.0, "window": 30.0}

    def notes(name):
        tables = {"system": f"odd_systems:{name}", "axes": axes, "run": run, "classes": narrow}
        both = scene(name, classes=narrow), wiperjax.parse_sweep(tables)
        return [[note for note in spec.notes() if "lip lengths" in note] for spec in both]

    for (note,) in notes("LipOnWiping"):
        assert note.startswith("classes.reversal_window is 0.01 s, but the glass needs up to 0.")
    assert notes("LipInTheAir") == [[], []]


def test_a_belt_of_ones_own_has_no_place_in_files():
    words = r"belt.kind: is missing; it must be 'steady', 'wiping' or 'trapezoid', .*, Running$"
    with pytest.raises(SpecError, match=f"^scene: {words}"):
        scene("OnRunning")
    with pytest.raises(SpecError, match=words):
        axes, run = {"mass": {"values": [1.0, 2.0]}}, {"transient": 0.0, "window": 1.0}
        wiperjax.parse_sweep({"system": "odd_systems:OnRunning", "axes": axes, "run": run})
    assert type(built("OnRunning", belt={"kind": "steady", "speed": 0.1}).belt) is (
        wiperjax.SteadyBelt
    )


@pytest.mark.parametrize(
    ("name", "what"),
    [
        *[("label", "a variable"), ("velocity_rms", "a variable"), ("result", "a variable")],
        *[("start", "a dimension"), ("coordinate", "a dimension"), ("event", "a dimension")],
        *[("title", "an attribute"), ("run_window", "an attribute"), ("host", "an attribute")],
        ("d_velocity_rms_d_mass", "a variable"),
    ],
)
def test_a_parameter_cannot_have_a_name_that_maps_use(name, what):
    with pytest.raises(ValueError, match=f"^system: m:C .* the name '{name}', .* of {what} of"):
        check_names("system", "m:C", ["mass", name])


def test_a_parameter_with_a_name_of_a_map_is_refused_before_anything_is_computed(monkeypatch):
    source = (
        "import own_systems, wiperjax\n"
        "class Named(own_systems.Ball):\n    label: float = wiperjax.parameter(1.0)\n"
        "class Law(own_systems.Falling):\n    label: float = wiperjax.parameter(1.0)\n"
    )
    module = types.ModuleType("named_as_maps")
    exec(source, vars(module))
    monkeypatch.setitem(sys.modules, "named_as_maps", module)
    words = "must not have a parameter of the name 'label', which is that of a variable of maps"
    with pytest.raises(SpecError, match=f"^scene: system: named_as_maps:Named {words}$"):
        wiperjax.parse_scene(SCENE | {"system": "named_as_maps:Named"})
    with pytest.raises(SpecError, match=f"^scene: blade.friction: named_as_maps:Law {words}$"):
        wiperjax.parse_scene({"run": SCENE["run"], "blade": {"friction": "named_as_maps:Law"}})


def test_every_name_of_a_map_is_taken():
    """Attributes are listed where names are checked: this finds one that was forgotten."""

    def evaluate(spec, index, *_):
        nothing = np.zeros(len(index))
        state = {f"final_{key}": np.zeros((len(index), 1)) for key in ("position", "velocity")}
        named = ("result", "velocity_rms", "belt_speed_rms", "stick_fraction", "slip_fraction")
        more = ("flight_fraction", "dominant_frequency")
        return {name: nothing for name in (*named, *more)} | state

    spec = wiperjax.parse_sweep(
        {
            "system": "odd_systems:OnWiping",
            "axes": {"mass": {"values": [1.0, 2.0]}},
            "run": {"transient": 0.0, "window": 20.0, "raster": 4, "samples": 64},
        }
    )
    ds = wiperjax.sweep(spec, evaluate=evaluate, progress=False)
    for name in {*ds.attrs, *ds.variables} - set(spec.parameter_names):
        with pytest.raises(ValueError, match=name):
            check_names("system", "m:C", [name])


def cells(name):
    axes = {"mass": {"values": [1.0, 2.0, 4.0]}}
    tables = {"run": {"transient": 0.0, "window": 20.0}, "classes": SCENE["classes"]}
    spec = wiperjax.parse_sweep({"system": f"odd_systems:{name}", "axes": axes} | tables)
    return build(spec, spec.cells(np.arange(3))).system


def test_a_table_is_not_read_as_a_value_of_each_cell():
    """One of as many points as a block has cells was, without a word."""
    must = (
        r"must be a number, a tuple of them or static \(equinox.field\(static=True\)\) in a sweep"
    )
    words = (
        rf"^system: field 'friction.speeds' of OnTable {must}, but was an array of shape \(5,\)$"
    )
    with pytest.raises(ValueError, match=words):
        cells("OnTable")
    with pytest.raises(ValueError, match=f"field 'mode' of Named {must}, but was 'soft'$"):
        cells("Named")
    assert built("OnTable").friction.speeds.shape == (5,)  # one motion has no cells


def test_a_tuple_of_numbers_is_that_of_all_cells():
    system = alike(cells("Driven"), "float64", 3)
    assert system.stiffness == 1 and system.load == 1  # absent at 1
    assert system.mass.shape == (3,) and np.shape(system.forces[1]) == ()
    time = np.linspace(0.0, 3.0, 3)
    (found,) = system.free_acceleration(time, (np.zeros(3),), (np.zeros(3),))
    np.testing.assert_allclose(found, np.interp(time, system.times, system.forces) / [1, 2, 4])
