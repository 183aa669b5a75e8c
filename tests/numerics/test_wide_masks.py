"""A program with wide masks computes what it computes with narrow ones, to the last bit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.machine import jax_settings, provenance
from wiperjax.numerics import wide_masks
from wiperjax.numerics.elementary import exp, larger
from wiperjax.numerics.fusion_barrier import keep

WIDTH = {"float64": np.dtype("int64"), "float32": np.dtype("int32")}


def state_of(dtype):
    x = jnp.asarray([-2.0, -0.5, 0.0, 0.25, jnp.nan, jnp.inf, 3.0], dtype)
    return {"x": x, "regime": jnp.arange(7, dtype=jnp.int32) % 3, "flag": x > 0, "count": x.size}


def step(limits, state):
    """Every kind of operation that a truth value or an enumeration takes part in."""
    x, regime, flag, count = (state[k] for k in ("x", "regime", "flag", "count"))
    low, strict = limits
    up = (x > low) & ~flag | (regime == 1) ^ (flag == strict)
    up = jnp.where(regime > 1, up, flag & jnp.isfinite(x))
    several = jnp.select([regime == 0, regime == 1], [x, -x], exp(larger(-x, low)))
    flag = jax.lax.max(flag, up & (x < 0)) | jax.lax.min(flag, up)
    turns = jax.lax.while_loop(lambda n: jnp.any(n < 3), lambda n: n + (n < 3), regime)
    third = jax.lax.select_n(regime, x, 2 * x, 3 * x)
    moved = keep(jnp.where(up, several, third) + up.astype(x.dtype) * turns.astype(x.dtype))
    bits = jax.lax.bitcast_convert_type(x, WIDTH[x.dtype.name]) << 1
    flag = (moved < 1) ^ (bits == 0) ^ (up > flag) ^ jnp.any(up)
    count = count + jnp.sum(up, dtype=count.dtype) + up.astype(jnp.int64).sum()
    worst = jnp.where(jnp.isnan(moved), jnp.asarray(-7, jnp.int32), -regime)
    return {"x": moved, "regime": worst + up, "flag": flag, "count": count}


@pytest.mark.parametrize("dtype", WIDTH)
def test_what_is_computed_stays_the_same(dtype):
    given, limits = state_of(dtype), (jnp.asarray(-1.0, dtype), jnp.asarray(True))
    given["count"] = jnp.asarray(given["count"])
    width = WIDTH[dtype]

    @jax.jit
    def wide(limits, state):
        run = wide_masks.with_wide_masks(step, state, width)
        return wide_masks.narrowed(run(limits, wide_masks.widened(state, width)), state)

    true, found = jax.jit(step)(limits, given), wide(limits, given)
    for name, value in true.items():
        assert found[name].dtype == value.dtype
        np.testing.assert_array_equal(found[name], value, err_msg=name)


def test_a_loop_carries_no_truth_value():
    given, width = state_of("float64"), WIDTH["float64"]
    given["count"] = jnp.asarray(given["count"])
    wide = wide_masks.widened(given, width)
    assert {x.dtype.name for x in jax.tree.leaves(wide)} == {"float64", "int64"}
    run = wide_masks.with_wide_masks(step, given, width)
    after = run((jnp.asarray(-1.0), jnp.asarray(True)), wide)
    assert jax.tree.map(lambda x: x.dtype, after) == jax.tree.map(lambda x: x.dtype, wide)
    assert set(np.unique(after["flag"]).tolist()) <= {-1, 0}


def test_derivatives_pass_through():
    """Those of one's own rules (`exp`, the larger of two) and none where one was stopped."""

    def curve(scale, state):
        x = jnp.where(state["flag"], exp(scale * state["x"]), larger(scale, state["x"]))
        return {**state, "x": x + jax.lax.stop_gradient(scale * state["x"])}

    state = {"x": jnp.asarray([0.3, -0.4, 2.0]), "flag": jnp.asarray([True, False, False])}
    wide = wide_masks.widened(state, WIDTH["float64"])
    run = wide_masks.with_wide_masks(curve, state, WIDTH["float64"])
    slopes = jax.jacfwd(lambda s: run(s, wide)["x"])(0.7)
    np.testing.assert_array_equal(slopes, jax.jacfwd(lambda s: curve(s, state)["x"])(0.7))
    assert slopes[0] == pytest.approx(0.3 * np.exp(0.21)) and slopes[1] == 1 and slopes[2] == 0


@pytest.mark.parametrize(
    ("bits", "flags", "there"),
    [
        (512, "", True),
        (512, "--xla_cpu_max_isa=AVX2 --xla_dump_to=x", False),
        (512, "--xla_cpu_max_isa=AVX512", True),
        (256, "", False),
        (0, "", False),
    ],
)
def test_masks_are_wide_where_no_register_is_for_them(bits, flags, there, monkeypatch):
    monkeypatch.setattr(provenance, "vector_bits", lambda: bits)
    monkeypatch.setenv("XLA_FLAGS", flags)
    assert jax_settings.mask_registers() == there
    width = wide_masks.width_for(jnp.zeros(3, jnp.float32))
    assert width == (None if there or jax.default_backend() != "cpu" else jnp.int32)


def test_where_they_are_as_good_nothing_changes():
    state = {"flag": jnp.asarray([True])}
    assert wide_masks.widened(state, None) is state
    assert wide_masks.with_wide_masks(step, state, None) is step
    assert wide_masks.narrowed(state, state)["flag"] is state["flag"]
