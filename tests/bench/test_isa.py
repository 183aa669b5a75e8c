"""`--isa`: measured as on a machine without wider vectors."""

import os
import subprocess
import sys

import pytest

from wiperjax.cli import main
from wiperjax.machine import provenance

LIMITED = """
from pathlib import Path
import wiperjax.cli  # as its command does
from wiperjax_bench.files import begin
begin(Path("x.h5"), 1, isa="avx2")
import jax.numpy as jnp, numba, numpy as np
from wiperjax_bench.harness import measure
assert float(jnp.arange(5.0).sum()) == 10  # XLA takes the flag
@numba.njit(fastmath=True)
def squares(x):
    total = 0.0
    for one in x:
        total += one * one
    return total
squares(np.ones(1000))
(code,) = squares.inspect_asm().values()
print("zmm" in code, "ymm" in code, measure.machine())
"""


@pytest.mark.skipif(provenance.vector_bits() < 256, reason="no vectors of 256 bits here")
def test_code_is_limited_to_narrow_vectors(tmp_path):
    asked = [sys.executable, "-c", LIMITED]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CPU")}
    done = subprocess.run(asked, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    wide, narrow, machine = done.stdout.split(maxsplit=2)
    assert (wide, narrow) == ("False", "True")
    assert machine.strip().endswith("code limited to AVX2")


def test_an_isa_that_is_not_known(tmp_path, capsys):
    assert main(["bench", "speed", "--isa", "avx3", "-o", str(tmp_path / "speed.h5")]) != 0
    assert "isa must be avx2 or sse4_2, but was 'avx3'" in capsys.readouterr().err
