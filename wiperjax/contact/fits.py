"""Whether a system says what the engine asks, before anything is computed.

Its methods are asked at its start for the kinds of what they return. What is wrong with one is one
line that names it: else it is an error somewhere in the engine, of its arithmetic.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..vocabulary import checks
from ..vocabulary.declared import SET_BY_THE_ENGINE
from ..vocabulary.parameters import PARAMETERS
from ..vocabulary.ranges import FINITE, POSITIVE, Range
from . import joints
from .belts import AbstractBelt
from .friction import AbstractFriction, check_rest
from .on_belt import OnBelt
from .space import contact
from .system import AbstractSystem, cast

SAME = 1e-6  # of W_tn and W_nt, relative
SINGULAR = 1e-12  # relative: a W that is so near to singular is so but for rounding
PIECES = 2**14  # of a motion that are looked at for a turn: a measured one has many
UNTRACED = (  # what JAX says of Python, or numpy, where values are known only when it runs
    jax.errors.ConcretizationTypeError,
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
)


def check(system: AbstractSystem, position: tuple, velocity: tuple, shape: tuple = ()) -> None:
    """Raises ValueError, one line that names the method, unless each of ``system`` answers at this
    state with as many numbers as are asked, and a unit force moves the contact its own way.

    ``shape``: of time and state, that of the numbers which there is one of for each cell. Of a
    system of this package only law and belt are asked, and those only if they are none of it.
    """
    n, kind = len(position), type(system).__name__
    t = jnp.zeros(shape)
    q, v = (tuple(x + t for x in part) for part in (position, velocity))
    check_partner(system, t)
    if _is_ours(system):
        return
    _check_fields(system)
    system = system.on_piece(system.first_piece(t))

    def numbers(method: str, count: int | None, *given) -> list:
        found = _asked(system, method, *given)
        return _numbers(f"{kind}.{method}", "", found, count, shape)

    numbers("free_acceleration", n, t, q, v)
    numbers("rates", n, t, q, v)
    for method, given in (("directions", (t, q)), ("scales", (n,))):
        found = _asked(system, method, *given)
        what = "two tuples of "
        if not isinstance(found, tuple | list) or len(found) != 2:
            must = f"must return {what}{n} numbers, one a coordinate, but returned {_told(found)}"
            raise ValueError(f"{kind}.{method} {must}")
        for part in found:
            _numbers(f"{kind}.{method}", what, part, n, shape)
    for size in jax.tree.leaves(system.scales(n)):
        checks.numbers(f"{kind}.scales", size, POSITIVE)
    touches = ("gap", t, q) if system.unilateral else ("normal_force", t, q, v)
    for method, *given in (touches, ("slip_speed", t, q, v), ("output", t, q, v)):
        _number(f"{kind}.{method}", _asked(system, method, *given), shape)
    _check_property(system, "bounce", shape, PARAMETERS["restitution"].range)
    if _called(f"{kind}.drive_period", lambda system: system.drive_period, system) is not None:
        _check_property(system, "drive_period", shape, POSITIVE)
    switches = len(numbers("switches", None, t, q, v))
    ends = _asked(system, "ends", t, q, v)
    if not isinstance(ends, tuple | list) or len(ends) != switches:
        must = f"must return {switches} answers, one a switch, but returned {_told(ends)}"
        raise ValueError(f"{kind}.ends {must}")
    _check_stops(system, switches, (t, q, v))
    _check_inertia(system, t, q, v)
    joints.check_system(system, t, q, v)


def check_law(law: Any, shape: tuple = ()) -> None:
    """Raises ValueError, one line that names it, unless a friction law is one."""
    checks.instance("friction", law, AbstractFriction, "a law such as Coulomb(0.5)")
    if _is_ours(law):
        return
    kind = type(law).__name__
    _number(f"{kind}.coefficient", _asked(law, "coefficient", jnp.zeros(shape)), shape)
    static = _called(f"{kind}.static", lambda law: law.static, law)
    _number(f"{kind}.static", static, shape, "be")
    check_rest(law)


def turns(system: AbstractSystem) -> bool:
    """Whether V passes through zero where one of the first `PIECES` of its motion from t = 0 on
    ends. Raises ValueError, as `check`, for a belt that does not answer."""
    t = jnp.zeros(())
    check_partner(system, t)

    def turned(piece):
        return jnp.logical_and(system.reverses(piece), jnp.isfinite(system.break_time(piece)))

    return bool(jnp.any(jax.vmap(turned)(system.first_piece(t) + jnp.arange(PIECES))))


def check_partner(system: AbstractSystem, t) -> None:
    """Raises ValueError unless law and belt of a system are such, and its pieces are numbers."""
    shape, owner = jnp.shape(t), system
    if (law := system.law) is not None:
        check_law(law, shape)
    if isinstance(system, OnBelt):
        owner = system.belt
        checks.instance("belt", owner, AbstractBelt, "a belt such as SteadyBelt(0.3)")
    if _is_ours(owner):
        return
    kind = type(owner).__name__
    piece = _asked(owner, "first_piece", t)
    _number(f"{kind}.first_piece", piece, shape)
    if (found := np.dtype(getattr(piece, "dtype", type(piece)))).kind not in "iu":
        must = "must return a whole number (an index)"
        raise ValueError(f"{kind}.first_piece {must}, but returned one of {found}")
    piece = jnp.zeros(shape, int)
    _number(f"{kind}.break_time", _asked(owner, "break_time", piece), shape)
    turns = _asked(owner, "reverses", piece)
    if np.dtype(getattr(turns, "dtype", type(turns))) != bool or np.shape(turns) not in ((), shape):
        must = "must return True or False, or what JAX has of them"
        raise ValueError(f"{kind}.reverses {must}, but returned {_told(turns)}")
    if isinstance(owner, AbstractBelt):
        _check_belt(owner, t, piece)


def _check_belt(belt: AbstractBelt, t, piece) -> None:
    """Raises ValueError unless the speed of a belt goes on, and what else it says is numbers.
    Traced values pass (`checks`)."""
    shape, kind = jnp.shape(t), type(belt).__name__
    for method, *given in (("velocity", t, piece), ("since_reversal", t)):
        _number(f"{kind}.{method}", _asked(belt, method, *given), shape)
    checks.numbers(f"{kind}.velocity", belt.velocity(t, belt.first_piece(t)), FINITE)
    for name in ("peak", "rms", "wiping_frequency", "judged_at"):
        _check_property(belt, name, shape, FINITE)
    joints.check_belt(belt, t)


def _check_property(owner: Any, name: str, shape: tuple, allowed: Range) -> None:
    """Raises ValueError unless a property is a number in a range. Traced values pass (`checks`)."""
    where = f"{type(owner).__name__}.{name}"
    found = _called(where, lambda owner: getattr(owner, name), owner)
    if callable(found):
        raise ValueError(f"{where} must be a property, but was a method")
    _number(where, found, shape, "be")
    checks.numbers(where, getattr(owner, name), allowed)


def _is_ours(part: Any) -> bool:
    """Whether a system, law or belt is one of this package: its tests have asked it."""
    return type(part).__module__.split(".")[0] == "wiperjax"


def _check_fields(system: AbstractSystem) -> None:
    """Raises ValueError where an ``__init__`` of its own leaves out a field that the engine sets:
    its default stands in the class alone."""
    for field in dataclasses.fields(system):
        if field.name in SET_BY_THE_ENGINE and field.name not in vars(system):
            must = "must set all fields, as super().__init__() does, but left out"
            raise ValueError(f"{type(system).__name__}.__init__ {must} {field.name!r}")


def _check_stops(system: AbstractSystem, switches: int, state: tuple) -> None:
    """Raises ValueError unless the stops are switches, and each has as many velocities behind it as
    there are coordinates."""
    kind, (t, q, _) = type(system).__name__, state
    stops: Any = system.stops
    whole = isinstance(stops, tuple | list) and all(isinstance(stop, int) for stop in stops)
    if not whole or not set(stops) <= set(range(switches)):
        must = f"must be a tuple of places of its {switches} switches, counted from 0"
        raise ValueError(f"{kind}.stops {must}, but was {stops!r}")
    for stop in stops:
        found = _asked(system, "rebound", stop, *state, t > 0)
        _numbers(f"{kind}.rebound", "", found, len(q), jnp.shape(t))


def _check_inertia(system: AbstractSystem, t, q, v) -> None:
    """Raises ValueError where a unit force at the contact drives it against itself: friction would
    drive what it is to hold. Traced values pass (`checks`).
    """
    if any(map(checks.is_traced, jax.tree.leaves((system, t, q, v)))):
        return
    c, kind = contact(system, t, q, v), type(system).__name__
    if checks.is_traced(c.w_tt):
        return
    back = contact(system, t, q, tuple(-x for x in v)).w_tt
    asked = (("tangential", "slip_speed", c.w_tt, system.law is not None),)
    asked += (("normal", "the gap", c.w_nn, system.unilateral),)
    for which, of, w, counts in asked:
        if counts and np.any(np.asarray(w) <= 0):
            must = f"must have a unit {which} force accelerate {of} in its own direction"
            raise ValueError(f"{kind}.directions {must}, but it does by {np.min(w):g}")
    if system.law is not None and np.any(np.asarray(back) <= 0):
        must = "must be a speed with its sign, linear in the velocities"
        was = f"a unit tangential force accelerated it by {np.max(c.w_tt):g} and, with these"
        raise ValueError(f"{kind}.slip_speed {must}, but {was} reversed, by {np.min(back):g}")
    if not system.coupled:
        return

    def approach(v):
        one = (jnp.ones_like(t), cast(system.rates(t, q, v), v))
        return jax.jvp(lambda t, q: system.gap(t, q) + 0 * t, (t, q), one)[1]

    w_nt = jax.jvp(approach, (v,), (cast(c.along_t, v),))[1]
    if np.any(np.abs(w_nt - c.w_tn) > SAME * np.sqrt(c.w_tt * c.w_nn)):
        must = "must be those of one mass matrix: what a unit tangential force does to the gap, a"
        must += " unit normal force does to slip_speed"
        raise ValueError(f"{kind}.directions {must}, but they do {w_nt} and {c.w_tn}")
    w = np.broadcast_arrays(c.w_tt, c.w_nn, c.w_tn)
    if np.any(none := w[0] * w[1] <= (1 + SINGULAR) * w[2] ** 2):
        tt, nn, tn = (x[none][0] for x in w)
        must = "must be those of a mass matrix: W_tt W_nn > W_tn^2, of what unit forces do to"
        must += " slip_speed and to the gap"
        raise ValueError(f"{kind}.directions {must}, but W was {tt}, {nn} and {tn}")


def _asked(owner: Any, method: str, *given) -> Any:
    """Return the kinds of what a method returns."""
    name = f"{type(owner).__name__}.{method}"
    return _called(name, lambda owner, *given: getattr(owner, method)(*given), owner, *given)


def _called(name: str, function: Callable, *given) -> Any:
    try:
        return eqx.filter_eval_shape(function, *given)
    except NotImplementedError as error:
        raise ValueError(f"{name} is missing: {error}") from None
    except UNTRACED as error:
        must = "must be written with jax.numpy (jnp.sin, jnp.where, jnp.maximum): no math, numpy, "
        must += "if, max, float or list index of values that are known only when it runs"
        raise ValueError(f"{name} {must}") from error
    except Exception as error:  # whatever it does wrong
        said = str(error).splitlines()[0] if str(error) else ""
        raise ValueError(f"{name} fails: {type(error).__name__}: {said}") from error


def _numbers(name: str, what: str, found: Any, count: int | None, shape: tuple) -> list:
    """Return what was found, a tuple of numbers. Raises ValueError for anything else."""
    asked = "a tuple of numbers" if count is None else f"{what}{count} numbers, one a coordinate"
    if hasattr(found, "dtype") and len(found.shape) == len(shape) + 1:  # an array of them
        found = [jax.ShapeDtypeStruct(found.shape[1:], found.dtype)] * found.shape[0]
    fine = isinstance(found, tuple | list) and (count is None or len(found) == count)
    wrong = next((x for x in found if not _is_number(x, shape)), found) if fine else found
    if not fine or wrong is not found:
        at = "" if wrong is found else " for one of them"
        raise ValueError(f"{name} must return {asked}, but returned {_told(wrong)}{at}")
    return list(found)


def _number(name: str, found: Any, shape: tuple, verb: str = "return") -> None:
    if not _is_number(found, shape):
        was = "returned" if verb == "return" else "was"
        raise ValueError(f"{name} must {verb} a number, but {was} {_told(found)}")


def _is_number(found: Any, shape: tuple) -> bool:
    if not checks.is_number(found) and getattr(found, "dtype", np.dtype("V")).kind not in "iuf":
        return False
    return np.shape(found) in ((), shape)


def _told(found: Any) -> str:
    if isinstance(found, tuple | list):
        return f"a tuple of {len(found)}"
    if isinstance(found, jax.ShapeDtypeStruct):
        kind = {"c": "complex number", "b": "truth value"}.get(found.dtype.kind, "number")
        return f"an array of shape {found.shape}" if found.shape else f"one {kind}"
    return "one number" if checks.is_number(found, arrays=False) else checks.shown(found)
