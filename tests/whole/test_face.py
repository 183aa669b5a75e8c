"""What `import wiperjax` costs and shows. Each test in a Python of its own: modules stay loaded."""

import subprocess
import sys

import pytest

HEAVY = "{'jax', 'xarray', 'scipy', 'matplotlib', 'numpy'}"


def python(code, *words):
    done = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["sweep", "--help"], ["nonsense"]])
def test_words_about_the_commands_need_no_library_of_numbers(words):
    code = f"import sys; from wiperjax.cli import main; main(); print({HEAVY} & set(sys.modules))"
    assert python(code, *words).endswith("set()\n")


def test_dir_shows_the_public_names_alone():
    names = python("import wiperjax, wiperjax.cycles; print(*dir(wiperjax))").split()
    assert {"Wiper", "simulate", "solve", "sweep", "open_map"} <= set(names)
    assert not {"cycles", "state", "lanes", "jax", "lazy_loader"} & set(names)


@pytest.mark.long
@pytest.mark.parametrize(
    "first",
    ["import wiperjax; wiperjax.Wiper", "import jax, wiperjax", "import wiperjax.numerics.types"],
)
def test_numbers_are_64_bit_ones_whatever_is_imported_first(first):
    code = f"{first}; import jax.numpy as jnp; print(jnp.asarray(0.1).dtype)"
    assert python(code) == "float64\n"


@pytest.mark.long
def test_a_public_name_is_the_same_whatever_was_imported_before():
    code = """
import wiperjax.runs.simulate, wiperjax.maps.verify, wiperjax.cycles
print(*(type(getattr(wiperjax, name)).__name__ for name in ("solve", "verify", "sweep")))
try:
    wiperjax.solv
except AttributeError as error:
    print(error)
"""
    kinds, error = python(code).splitlines()
    assert kinds == "function function function"
    assert "wiperjax" in error and "attribute" in error and "solv" in error


def test_a_map_opens_without_jax():
    code = "import sys, wiperjax; wiperjax.open_map; print('jax' in sys.modules)"
    assert python(code) == "False\n"


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("velocty_rms", "did you mean velocity_rms?"),
        ("load", "did you mean normal_load?"),
        ("zzz", "it holds normal_load, velocity_rms"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_nearest(name, end):
    from wiperjax.vocabulary.wording import not_there

    names = ["normal_load", "velocity_rms"]
    assert not_there(name, "map", names) == f"{name!r} is not in this map; {end}"
