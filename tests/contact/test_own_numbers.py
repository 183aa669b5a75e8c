"""Numbers of whatever type: the motion is that of their values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax import Coulomb, SteadyBelt, TrapezoidBelt, Wiper, remedy
from wiperjax.contact.own_numbers import in_full
from wiperjax.cycles.find import find_cycle

SINGLE = float(np.float32(6e-3))


def ends(blade, **options):
    """Places of the tip at the end, by both doors."""
    by_hand = wiperjax.simulate(blade, 0.02, sample_interval=1e-2, **options)
    return [
        float(wiperjax.solve(blade, 0.02, **options).final_position[0]),
        float(by_hand.final_position[0]),
    ]


@pytest.mark.long
@pytest.mark.parametrize("number", [np.uint8(1), jnp.uint8(1), np.uint64(1)])
def test_a_belt_of_a_whole_number_turns_back(number):
    """The plateau of -1 m/s was one of 255 m/s."""
    blade = Wiper(belt=TrapezoidBelt(number, 60.0, 4e-3))
    assert ends(blade) == ends(Wiper(belt=TrapezoidBelt(1.0, 60.0, 4e-3)))
    run = wiperjax.simulate(blade, 0.02, sample_interval=1e-3)
    assert float(run.belt_velocity.min()) == pytest.approx(-1.0)


@pytest.mark.long
@pytest.mark.parametrize("number", [np.float32(SINGLE), jnp.float32(SINGLE)])
def test_a_length_in_single_precision_leaves_the_tolerance(number):
    """Its reciprocal was one of seven digits: at rtol = 1e-10 the tip was off by 4e-10 m."""
    belt = TrapezoidBelt(1.0, 60.0, 4e-3)
    found = ends(Wiper(belt=belt, lip_length=number), rtol=1e-10)
    exact = ends(Wiper(belt=belt, lip_length=SINGLE), rtol=1e-10)
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def test_what_is_no_number_of_the_system_keeps_its_type():
    class Table(wiperjax.AbstractFriction):
        values: jax.Array
        place: jax.Array
        static = 1.0

        def coefficient(self, speed):
            return self.values[self.place]

    table = Table(jnp.array([0.1, 0.5], "float32"), jnp.array(1))
    blade = in_full(Wiper(friction=table, hinge_mass=np.float64(0.0)))
    assert isinstance(blade.friction, Table) and blade.friction.place.dtype == int
    assert blade.friction.values.dtype == float
    assert type(blade.hinge_mass) is float  # whose terms are left out, if it is 0
    assert in_full(Wiper(friction=Coulomb(jnp.uint8(1)))).friction.static.dtype == float


@pytest.mark.parametrize("angles", [jnp.array([0.1]), np.array([0.1, 0.2])])
def test_a_batch_in_place_of_a_number_is_named(angles):
    """`solve` said that initial_state must have the coordinates of the wiper, but had 2."""
    said = "^system must have one number as attack_angle, a float, but had "
    with pytest.raises(ValueError, match=said):
        wiperjax.solve(Wiper(attack_angle=angles), 0.01)
    with pytest.raises(ValueError, match=said):
        jax.jit(lambda x: wiperjax.solve(Wiper(attack_angle=x), 0.01).result)(angles)


FOR_A_PERSON = {
    "simulate": lambda blade: wiperjax.simulate(blade, 0.01),
    "basins": lambda blade: wiperjax.basins(blade, ((0.0, 0.0), (0.0, 0.0)), 0.0, 0.01),
    "modes": wiperjax.modes,
    "find_cycle": lambda blade: find_cycle(blade, settle=0.01),
    "stabilise": lambda blade: remedy.stabilise(blade, {"attack_angle": (0.1, 0.2)}),
}


@pytest.mark.parametrize("name", FOR_A_PERSON)
def test_what_computes_on_the_host_is_refused_where_jax_traces(name):
    """A traceback of JAX, of one of five kinds, after the motion was compiled."""

    def asked(load):
        FOR_A_PERSON[name](Wiper(normal_load=load))
        return load

    for traced in (
        lambda: jax.jit(asked)(8.0),
        lambda: jax.vmap(asked)(jnp.array([8.0, 9.0])),
        lambda: jax.jvp(asked, (8.0,), (1.0,)),
        lambda: jax.jit(lambda: asked(8.0))(),
    ):
        with pytest.raises(ValueError, match=r"^system must be given outside of jax.jit, .*solve"):
            traced()


def test_other_numbers_that_jax_traces_are_named():
    def start(x):
        wiperjax.simulate(Wiper(), 0.01, initial_state=((x, 0.1), (0.0, 0.0)))

    for name, asked in (
        ("duration", lambda x: wiperjax.simulate(Wiper(), x)),
        ("each number of initial_state", start),
    ):
        with pytest.raises(ValueError, match=f"^{name} must be known outside of jax.jit, jax.vmap"):
            jax.vmap(asked)(jnp.array([0.1, 0.2]))


def test_without_64_bits_nothing_is_computed(tmp_path):
    """Switched off behind our back, motions were those of float32, and said to reach their end."""
    blade = Wiper(belt=SteadyBelt(0.3))
    cells = {
        "axes": {"belt_speed": {"values": [0.2, 0.3]}},
        "run": {"transient": 0.02, "window": 0.05},
    }
    asked = (
        lambda: wiperjax.simulate(blade, 0.05),
        lambda: wiperjax.solve(blade, 0.05),
        lambda: wiperjax.steady_slip(blade),
        lambda: wiperjax.modes(blade),
        lambda: wiperjax.sweep(cells, tmp_path / "map.h5", progress=False),
    )
    jax.config.update("jax_enable_x64", False)  # as another library may
    try:
        for ask in asked:
            with pytest.raises(ValueError, match="^jax_enable_x64 must be True, .* but was False"):
                ask()
    finally:
        jax.config.update("jax_enable_x64", True)
    assert not list(tmp_path.iterdir())
