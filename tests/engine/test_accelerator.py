"""What an accelerator is given: programs that lower for CUDA, also on a machine that has none; and
where there is one, the same motions."""

import os
import subprocess
import sys

import equinox as eqx
import jax
import numpy as np
import pytest
from jax import export

import wiperjax
from wiperjax import SteadyBelt, Wiper
from wiperjax.maps import block
from wiperjax.maps.cells import batch, devices
from wiperjax.maps.cells.evaluate import evaluate
from wiperjax.specs.load import parse_sweep


def sweep(solver="dopri8", **run):
    run = {"transient": 0.005, "window": 0.02, "samples": 64, "solver": solver} | run
    return parse_sweep(
        {
            "axes": {"attack_angle": {"start": -30, "stop": 30, "num": 40}},
            "belt": {"speed": 0.3},
            "run": run,
        },
        "test.toml",
    )


class Caught(Exception):
    """The arguments of a program instead of its answer."""


@pytest.fixture
def elsewhere(monkeypatch):
    """As if jax computed on a GPU, as far as this package asks."""
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")


def lowered(function, arguments) -> export.Exported:
    arrays, plain = eqx.partition(arguments, eqx.is_array)
    program = jax.jit(lambda arrays: function(*eqx.combine(arrays, plain)))
    return export.export(program, platforms=["cuda"])(arrays)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["tsit5", "dopri8"])
def test_the_engine_of_a_map_lowers_for_cuda(solver, elsewhere, monkeypatch):
    def catch(*arguments):
        raise Caught(arguments)

    monkeypatch.setattr(batch, "compute", catch)
    spec = sweep(solver)
    with pytest.raises(Caught) as caught:
        evaluate(spec, np.arange(spec.size))
    program = lowered(batch.outcomes, caught.value.args[0])
    assert program.platforms == ("cuda",)
    rows = jax.tree.unflatten(program.out_tree, program.out_avals)[0]
    assert {table.shape[0] for table in rows.tables} == {devices.capacity(spec.size)}
    assert {table.dtype for table in rows.tables} == {np.dtype("float64"), np.dtype("int32")}
    # nothing in it is the host processor's: the barrier against its compiler is a call
    assert "inlineable" not in program.mlir_module()


def test_one_motion_lowers_for_cuda(elsewhere):
    def motion(angle):
        wiper = Wiper(belt=SteadyBelt(0.3), attack_angle=angle)
        return wiperjax.solve(wiper, 0.02, max_events=16)

    program = lowered(motion, (np.asarray(0.1),))
    assert program.platforms == ("cuda",)
    assert "inlineable" not in program.mlir_module()


def test_blocks_and_lanes_fill_an_accelerator(monkeypatch):
    spec = sweep(transient=0.05, window=0.05)
    axis = spec.axes["attack_angle"].model_copy(update={"num": 4_000_000})
    spec = spec.model_copy(update={"axes": {"attack_angle": axis}})
    monkeypatch.setattr(block, "accelerated", lambda: False)
    here = block.block_size(spec)
    monkeypatch.setattr(block, "accelerated", lambda: True)
    monkeypatch.setattr(devices, "on_accelerator", lambda: True)
    there = block.block_size(spec)
    assert here <= 2**15 < 2**17 < there
    assert devices.lane_count("float64", there) >= 0.9 * devices.WIDE / 2


ON_THE_PROCESSOR = """
import runpy, sys
import numpy as np
np.savez(sys.argv[2], **runpy.run_path(sys.argv[1])["motions"]())
"""


def motions():
    spec = sweep()
    found = evaluate(spec, np.arange(spec.size))
    counts = ("result", "impact_count", "stick_count", "lift_off_count")
    return {name: found[name] for name in (*counts, *CLOSE)}


CLOSE = ("stick_fraction", "velocity_rms", "normal_force_max")


@pytest.mark.skipif(jax.default_backend() == "cpu", reason="no accelerator here")
def test_an_accelerator_sees_the_motions_that_the_processor_sees(tmp_path):
    command = [sys.executable, "-c", ON_THE_PROCESSOR, __file__, tmp_path / "there.npz"]
    done = subprocess.run(command, env=os.environ | {"JAX_PLATFORMS": "cpu"})
    assert done.returncode == 0
    with np.load(tmp_path / "there.npz") as there:
        for name, here in motions().items():
            close = {"rtol": 1e-3, "atol": 1e-6} if name in CLOSE else {"rtol": 0}
            np.testing.assert_allclose(here, there[name], **close, err_msg=name)
