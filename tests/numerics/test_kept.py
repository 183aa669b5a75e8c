"""A traced program that is kept answers as one that was traced now, or it is traced now."""

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax import SteadyBelt, Wiper, WipingBelt
from wiperjax.blade.steady_slip import steady_slip
from wiperjax.contact.regimes import slips
from wiperjax.machine import jax_settings
from wiperjax.numerics import kept
from wiperjax.numerics.kept import Kept, as_arrays
from wiperjax.systems.numbers import traceable

TRACED = []


def area(sides, power):
    TRACED.append(power)
    return {"area": sides[0] * sides[1] ** power, "sides": sides}


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "folder", lambda: tmp_path)
    TRACED.clear()
    return tmp_path


def sides(n=3):
    return jnp.arange(1.0, n + 1), jnp.asarray(2.0)


def test_the_next_process_does_not_trace(place):
    first = Kept(area)(sides(), 2)
    again = Kept(area)(sides(), 2)  # knows nothing of the other but its folder
    assert TRACED == [2]
    assert jax.tree.structure(first) == jax.tree.structure(again)
    np.testing.assert_array_equal(again["area"], [4.0, 8.0, 12.0])
    np.testing.assert_array_equal(first["area"], again["area"])


@pytest.mark.parametrize(
    "other",
    [(sides(4), 2), (sides(), 3), (sides(), 2.0), ((jnp.arange(1, 4), jnp.asarray(2.0)), 2)],
)
def test_other_kinds_of_arguments_are_other_programs(place, other):
    program = Kept(area)
    program(sides(), 2)
    program(*other)
    assert len(TRACED) == 2 and len(list(place.iterdir())) == 2


@pytest.mark.parametrize(
    "setting",
    [
        lambda: jax.default_matmul_precision("bfloat16"),
        lambda: jax.numpy_dtype_promotion("strict"),
        lambda: jax.numpy_rank_promotion("raise"),
        lambda: jax.threefry_partitionable(not jax.config.jax_threefry_partitionable),
    ],
)
def test_other_settings_of_jax_are_other_programs(place, setting):
    """Else what is traced under one would answer under another, in later processes, too."""
    program = Kept(number)
    program(jnp.asarray(2.0))
    with setting():
        program(jnp.asarray(2.0))
    assert len(TRACED) == 2 and len(list(place.iterdir())) == 2


def number(x):
    TRACED.append(x)
    return x


def test_without_jit_the_function_itself_runs(place):
    """With its numbers: who switches it off wants to look at them."""
    with jax.disable_jit():
        Kept(number)(jnp.asarray(3.0))
    assert TRACED == [3.0] and list(place.iterdir()) == []


@pytest.mark.parametrize("damage", [b"", b"no program", None])
def test_a_damaged_program_is_traced_again(place, damage):
    Kept(area)(sides(), 2)
    (path,) = place.iterdir()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2] if damage is None else damage)
    np.testing.assert_array_equal(Kept(area)(sides(), 2)["area"], [4.0, 8.0, 12.0])
    assert len(TRACED) == 2
    Kept(area)(sides(), 2)
    assert len(TRACED) == 2  # and mended


def test_code_that_no_version_tells_is_not_kept(place):
    class Own(eqx.Module):
        side: jax.Array

    def square(own):
        return own.side**2

    assert Kept(square)(Own(jnp.asarray(3.0))) == 9.0
    assert list(place.iterdir()) == []


def doubled(x):
    return 2 * x


def test_functions_of_ones_own_are_not_kept(place):
    """Two of one name would be found as one."""

    def applied(function, x):
        return function(x)

    for own in (doubled, lambda x: 3 * x):
        assert Kept(applied)(own, jnp.asarray(3.0)) == own(3.0)
    assert list(place.iterdir()) == []
    assert Kept(applied)(slips, jnp.asarray(1)) == slips(1)
    assert len(list(place.iterdir())) == 1


class Doubling:
    def __call__(self, x):
        return 2 * x


@pytest.mark.parametrize("nameless", [partial(jnp.multiply, 2), Doubling()])
def test_what_is_called_and_has_no_name_is_not_kept(place, nameless):
    """Its name was asked for: a system with such a force ended in an AttributeError."""
    program = Kept(lambda x, f: f(x))
    assert float(program(jnp.asarray(3.0), nameless)) == 6.0
    assert not list(place.iterdir())


def test_code_in_a_static_field_is_not_kept(place):
    """A solver of one's own was written down by its name alone: a later process took its program
    for that of another solver of the name."""

    def scaled(holder, x):
        return holder.rule.factor * x

    class Holder(eqx.Module):
        rule: eqx.Module = eqx.field(static=True)

    Holder.__module__, Holder.__qualname__ = Kept.__module__, "Holder"  # as one of this package

    def rule(of):
        class Rule(eqx.Module):
            factor: ClassVar[float] = of

        Rule.__qualname__ = "Rule"
        return Rule()

    for factor in (2.0, 3.0):
        assert Kept(scaled)(Holder(rule(factor)), jnp.asarray(5.0)) == factor * 5.0
    assert not list(place.iterdir())


def test_functions_of_one_name_are_two_programs(place):
    other = type(doubled)(doubled.__code__, globals(), "doubled")
    other.__module__ = "elsewhere"
    Kept(doubled)(jnp.asarray(3.0))
    Kept(other)(jnp.asarray(3.0))
    assert len(list(place.iterdir())) == 2


def test_what_cannot_be_written_down_is_traced_in_each_process(place):
    def watched(x):
        return eqx.error_if(x, x < 0, "below zero")

    assert Kept(watched)(jnp.asarray(3.0)) == 3.0
    with pytest.raises(Exception, match="below zero"):
        Kept(watched)(jnp.asarray(-3.0))
    assert list(place.iterdir()) == []


def test_source_that_changed_under_a_process_is_not_kept(place, monkeypatch):
    """What was imported before an update would be found by processes after it, as theirs."""
    source = kept._source()
    monkeypatch.setattr(kept, "_source", lambda: source + " edited")
    assert Kept(area)(sides(), 2)["area"][2] == 12.0
    assert list(place.iterdir()) == [] and TRACED == [2]


def test_inside_another_trace_it_is_differentiated(place):
    slope = jax.grad(lambda x: Kept(area)((x, jnp.asarray(2.0)), 2)["area"])(jnp.asarray(3.0))
    assert slope == 4.0 and list(place.iterdir()) == []


@pytest.mark.parametrize("nowhere", [None, ""])  # "" wrote into a folder of the working directory
def test_nothing_is_kept_where_jax_keeps_nothing(monkeypatch, nowhere):
    assert kept.folder() is not None  # as this suite is set up
    monkeypatch.setattr(kept, "CONFIG", type("Config", (), {"jax_compilation_cache_dir": nowhere}))
    monkeypatch.setattr(kept.CONFIG, "jax_enable_compilation_cache", True, raising=False)
    assert kept.folder() is None
    assert Kept(area)(sides(), 2)["area"][0] == 4.0


def test_the_programs_longest_out_of_use_go(place, monkeypatch):
    monkeypatch.setattr(kept, "MOST_KEPT", 2)
    for n in (2, 3, 4):
        Kept(area)(sides(n), 2)
    assert len(list(place.iterdir())) == 2


def test_numbers_that_switch_terms_off_stay_numbers():
    made = as_arrays({"off": 0, "one": 1.0, "on": 2.5, "each": np.arange(3.0)}, "float32")
    assert made["off"] == 0 and isinstance(made["off"], int) and isinstance(made["one"], float)
    assert made["on"].dtype == made["each"].dtype == jnp.float32


@pytest.mark.long
def test_the_derivative_of_steady_slip_is_kept(place):
    """Its root is differentiated by a quotient: a solver of equations would have a callback."""
    first = Kept(growth_and_slope)
    blade = Wiper(belt=SteadyBelt(0.3), attack_angle=0.3)
    growth, slope = first(jnp.asarray(0.3))
    assert len(list(place.iterdir())) == 1
    step = 1e-5
    near = [first(jnp.asarray(0.3 + k * step))[0] for k in (-1, 1)]
    np.testing.assert_allclose(slope, (near[1] - near[0]) / (2 * step), rtol=1e-6)
    np.testing.assert_allclose(growth, steady_slip(blade).growth_rate, rtol=1e-12)


def growth_and_slope(angle):
    def growth(angle):
        return steady_slip(replace(Wiper(belt=SteadyBelt(0.3)), attack_angle=angle)).growth_rate

    return jax.jvp(growth, (angle,), (jnp.ones_like(angle),))


def test_programs_of_two_kinds_do_not_wait_for_each_other(place):
    both = threading.Barrier(2)

    def met(x):
        both.wait(30)
        return x

    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(Kept(met), (jnp.ones(2), jnp.ones(3))))
    assert [len(x) for x in found] == [2, 3]


def test_a_wiper_has_few_programs():
    """Only numbers that say so switch terms off: the others share a program at any value."""
    plain = Wiper(attack_angle=0.0, mu_static=1.0, stribeck_shape=1.0)
    other = replace(plain, attack_angle=0.1, mu_static=0.9, restitution=0.0, belt=SteadyBelt(1.0))
    for made in (lambda wiper: as_arrays(wiper, "float64"), traceable):
        kinds = [eqx.partition(made(wiper), eqx.is_array)[1] for wiper in (plain, other)]
        assert eqx.tree_equal(*kinds)
        assert kinds[0].stribeck_shape == 1.0 and kinds[0].hinge_mass == 0.0
        slow, fast = (made(replace(plain, belt=WipingBelt(v, 1.0, 0.0))) for v in (0.5, 1.0))
        assert eqx.tree_equal(*(eqx.partition(x, eqx.is_array)[1] for x in (slow, fast)))
        bent = eqx.partition(made(replace(plain, stribeck_shape=2.0)), eqx.is_array)[1]
        assert bent.stribeck_shape is None


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="options of XLA on a host")
def test_passes_of_xla_that_the_user_leaves_out_stay_left_out(monkeypatch):
    """A program's own list of them replaces that of ``XLA_FLAGS``, which was lost in these."""
    name, ours = "xla_disable_hlo_passes", ",".join(jax_settings.SKIPPED)
    for flags in ("", "--xla_cpu_prefer_vector_width=512", f"--a=b --{name}={ours}"):
        monkeypatch.setenv("XLA_FLAGS", flags)
        assert kept._options() == {name: ",".join((ours, *kept.NEEDLESS))}
    for flags in (f"--{name}=fusion", f"--a=b --{name}={ours},fusion"):
        monkeypatch.setenv("XLA_FLAGS", flags)
        assert kept._options() == {}
