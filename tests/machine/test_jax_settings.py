"""What XLA is asked for: nothing that this version of it, or the device, cannot take."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import processes
import pytest

from wiperjax.machine import jax_settings, provenance


@pytest.fixture
def flags(monkeypatch):
    """Return a function: what `configure` asks for where nothing is set yet."""

    def asked():
        monkeypatch.setenv("XLA_FLAGS", "")
        jax_settings.configure(1, keep=False)
        return os.environ["XLA_FLAGS"]

    return asked


@pytest.mark.parametrize("version, has", [("0.10.2", True), ("0.11.0", False)])
def test_a_flag_that_newer_versions_have_lost_ends_no_process(version, has, flags, monkeypatch):
    monkeypatch.setattr(provenance, "version", lambda _: version)
    assert ("--xla_cpu_use_fusion_emitters" in flags()) == has


@pytest.mark.parametrize("there", [True, False])
def test_an_accelerator_knows_how_long_its_loops_are(there, flags, monkeypatch):
    monkeypatch.setattr(jax_settings, "accelerators", lambda: there)
    asked = flags()
    assert ("--xla_gpu_enable_command_buffer" in asked) == there
    assert ("while-loop-trip-count-annotator" in asked) != there


def test_what_nobody_reads_of_a_persons_own_loop_is_not_computed():
    """With one more pass of XLA's left out, a batch of `solve` of which one number was wanted took
    twice as long."""

    def third(x):
        step = lambda c: (c[0] + 1, jnp.sin(c[1]), 2 * c[2])
        return jax.lax.while_loop(lambda c: c[0] < 5, step, (0, jnp.ones(9), x))[2]

    assert "sine" not in jax.jit(third).lower(1.0).compile().as_text()


def test_what_the_user_has_set_wins(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_prefer_vector_width=256")
    jax_settings.configure(1, keep=False)
    assert os.environ["XLA_FLAGS"].count("prefer_vector_width") == 1


@pytest.mark.parametrize(
    "asked, there, taken",
    [("cuda", False, False), ("cuda", True, True), ("cuda,cpu", False, True), ("", False, True)],
)
def test_a_device_that_cannot_be_there_is_refused_by_name(asked, there, taken, flags, monkeypatch):
    monkeypatch.setattr(jax_settings, "accelerators", lambda: there)
    monkeypatch.setenv("JAX_PLATFORMS", asked)
    if taken:
        assert flags()
    else:
        with pytest.raises(ValueError, match="^JAX_PLATFORMS must be cpu .* but was 'cuda'$"):
            flags()


PROGRAM = """
import os
import wiperjax
import own_systems  # laws of one's own, made as the file is imported
wiperjax.configure(1)
import jax.numpy as jnp
jnp.zeros(())
wiperjax.configure(1)  # there already
os.environ["XLA_FLAGS"] = ""
wiperjax.configure(1)
"""


def test_settings_that_come_too_late_are_one_line():
    """A law of one's own computed as it was made: after the import of its file a sweep took ten
    times as long, without a word."""
    environment = processes.environment() | {"XLA_FLAGS": ""}
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    (line,) = done.stderr.splitlines()
    assert line.startswith("configure must come before the first computation, but JAX had started")
