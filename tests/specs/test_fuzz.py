"""Mutated sweep and scene files: each is refused in one line that names the key, or is sound.

Sound is a specification whose text, cells, notes and size of blocks can be worked out and are
bounded: nothing is left that could fail once the computation has begun.
"""

import copy
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wiperjax.datasets import map_dataset
from wiperjax.maps import estimate
from wiperjax.maps.block import BLOCK_BYTES, block_size
from wiperjax.maps.block import MOST_CELLS as BLOCK_CELLS
from wiperjax.specs.load import SpecError, load_scene, load_sweep, parse_scene, parse_sweep
from wiperjax.vocabulary.parameters import PARAMETERS
from wiperjax.vocabulary.ranges import MOST_CELLS, MOST_SAMPLES, MOST_VALUES, SETTINGS
from wiperjax.vocabulary.thresholds import LIMITS

SWEEP = """
title = "small"
model = "lip"
[axes]
attack_angle = { start = -40, stop = 40, num = 5 }
normal_load = { values = [5, 15] }
stribeck_speed = { start = 0.02, stop = 1.0, num = 3, spacing = "geometric" }
[blade]
restitution = 0.5
shoulder_angle = 30
tip_mass = 2e-3
[run]
transient = 0.2
window = 0.1
rtol = 1e-9
atol = 1e-9
precision = "float64"
solver = "tsit5"
max_steps = 1000
zeno_time = 1e-8
samples = 2048
raster = 20
event_log = 3
[start]
position = [1e-3, 0]
velocity = [0, 0]
[classes]
squeal_band = [500, 1000]
chatter_band = [0, 100]
reversal_window = 0.02
tone_time = 0.01
settled_change = 0.1
[sensitivities]
parameters = ["attack_angle"]
check = 0.1
step = 1e-5
grazing = 1e-4
"""
OF_ANOTHER_SYSTEM = """
system = "oscillator"
[axes]
stiffness = { values = [1, 2] }
[parameters]
friction = "stribeck"
mu_static = 0.5
stribeck_speed = 0.3
[run]
transient = 20
window = 60
[starts]
random = 5
seed = 1
position = [[-1, 1]]
velocity = [[0, 1]]
"""
REFINED = """
[axes]
attack_angle = { start = -40, stop = 40, num = 5 }
[run]
transient = 0.2
window = 0.1
[refine]
on = "velocity_rms=0.1"
resolution = 0.01
box = { attack_angle = [-10, 10] }
max_cells = 1000
probes = 10
lengthen = 2
splits = 1
"""
BELTS_OF_FILES = {
    "steady": 'kind = "steady"\nspeed = 0.3\n',
    "wiping": 'kind = "wiping"\namplitude = 0.3\nfrequency = 0.7\nphase = 10\n',
    "trapezoid": 'kind = "trapezoid"\nspeed = 0.3\nfrequency = 0.7\nramp = 0.05\nphase = 10\n',
}
SCENE = """
title = "scene"
[blade]
restitution = 0.5
[run]
duration = 0.1
sample_interval = 1e-4
rtol = 1e-8
[start]
angle = 5
[classes]
reversal_window = 0.02
"""
GOOD = {
    (kind, belt): f"{text}\n[belt]\n{keys}"
    for kind, text in (("sweep", SWEEP), ("scene", SCENE))
    for belt, keys in BELTS_OF_FILES.items()
}
GOOD |= {("sweep", "another"): OF_ANOTHER_SYSTEM, ("sweep", "refined"): REFINED}
PARSE = {"sweep": parse_sweep, "scene": parse_scene}
LOAD = {"sweep": load_sweep, "scene": load_scene}


def nested(depth, inner=1):
    for _ in range(depth):
        inner = {"a": inner} if depth % 2 else [inner]
    return inner


# What was seen to end in a traceback, to hang, or to fail after the work, and more of the kind.
VALUES = [
    0, -1, 1, 16, 1e-300, 1e-20, 1e300, 1e308, -1e308, 5e-324, 10**6, 10**7, 10**9, 2**31, 2**63,
    10**60, -(10**60), 10**400, float("inf"), float("-inf"), float("nan"), True, "", "a",
    "a" * 5000, "\x00", "\ud800", "a\nb", "steady", [], [1], [1, 2], [2, 1], [500, float("inf")],
    [1e308, -1e308], [0.0, 1e-320], [1] * 1000, ["attack_angle"], ["a" * 5000], [[1, 2]], {},
    {"a": 1}, {"start": 0, "stop": 1, "num": 10**7}, {"start": 1, "stop": 1 + 1e-15, "num": 99},
    {"values": [1e-320, 1]}, nested(900), nested(901), None, object(), 1j, b"x",
]  # fmt: skip
KEYS = [
    "zzz", "a" * 5000, "", "\n", "\x00", "é", "values", "start", "kind", "parameters", "belt_speed",
    "gravity", "restitution", "num", "axes", "run",
]  # fmt: skip
KNOWN = {"axes", "belt", "blade", "run", "start", "classes", "sensitivities", "title", "model"}
KNOWN |= {"system", "parameters", "starts", "refine"}
plausible = st.one_of(st.floats(1e-3, 1e2), st.integers(1, 4000), st.floats(0, 1))
values = st.one_of(
    plausible, plausible, st.floats(), st.integers(), st.sampled_from(VALUES), st.text(max_size=9)
)


def others(kind):
    """What tells the good files of a kind apart."""
    return sorted(other for of, other in GOOD if of == kind)


def tables(document, route=()):
    """Routes to all tables of a document that was not mutated yet."""
    yield route
    for key, value in document.items():
        if isinstance(value, dict):
            yield from tables(value, (*route, key))


@st.composite
def mutated(draw, kind):
    """A document with one to three mutations, and the keys that they touched."""
    document = tomllib.loads(GOOD[kind, draw(st.sampled_from(others(kind)))])
    routes = list(tables(document))
    touched = []
    for _ in range(draw(st.sampled_from([1, 1, 2, 3]))):
        route = draw(st.sampled_from(routes))
        table = document
        for key in route:
            table = table.get(key, {}) if isinstance(table, dict) else {}
        if not isinstance(table, dict):
            continue
        deed = draw(st.sampled_from(["set", "set", "set", "add", "drop"]))
        if deed == "add" or not table:
            key = draw(st.one_of(st.sampled_from(KEYS), st.sampled_from(sorted(PARAMETERS))))
        else:
            key = draw(st.sampled_from(sorted(table, key=str)))
        if deed == "drop":
            table.pop(key, None)
        else:
            table[key] = copy.copy(draw(values))
        touched.append((*route, key))
    return document, touched


def check_line(line, source, document):
    """One line of bearable length, that names a key of the file."""
    assert line.startswith(f"{source}: ")
    said = line.removeprefix(f"{source}: ")
    assert len(said) < 300 and "\n" not in said and said.isprintable(), said
    where = re.split(r"[.:]", said)[0]
    keys = KNOWN | {str(key) for key in document}
    assert where in keys or said.startswith(("'", '"', "aaaa")), said


def check_sweep(spec):
    """Everything that the driver asks of a specification before and while it computes."""
    assert 1 <= spec.size <= MOST_CELLS and max(spec.shape) <= MOST_VALUES
    if spec.size > 10**5:  # as good as any, but for the time
        spec = spec.model_copy(update={"axes": dict(list(spec.axes.items())[:1])})
        if spec.size > 10**5:
            return
    meaning = json.loads(spec.canonical())
    assert json.loads(json.dumps(meaning, allow_nan=False)) == meaning
    assert parse_sweep(spec.document()).digest() == spec.digest()
    map_dataset.describe(spec)
    assert all(len(note) < 300 and note.isprintable() for note in spec.notes())
    assert len(estimate.words(spec, 2)) < 200
    for workers in (1, 100):
        size = block_size(spec, workers)
        assert 1 <= size <= BLOCK_CELLS
        assert size == 1 or size * 4 * (spec.run.samples or 0) <= BLOCK_BYTES
    cells = spec.cells(np.array([0, spec.size - 1]))
    for name, value in cells.items():
        assert np.all(np.isfinite(value)), name
        assert spec.parameter_table[name].argument_problem(np.asarray(value)) is None, name


def check_scene(spec):
    assert all(np.isfinite(value) for value in spec.parameters().values())
    again = parse_scene(json.loads(json.dumps(spec.document())))
    assert again.document() == spec.document()
    assert spec.thresholds().reversal_window > 0


CHECK = {"sweep": check_sweep, "scene": check_scene}
OFTEN = settings(
    max_examples=400,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)


def test_what_is_mutated_is_good():
    for (kind, _), text in GOOD.items():
        CHECK[kind](PARSE[kind](tomllib.loads(text)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sweep", "scene"])
def test_mutated_documents(kind):
    counts = {"refused": 0, "taken": 0}

    @OFTEN
    @given(mutated(kind))
    def run(mutation):
        document, _ = mutation
        try:
            spec = PARSE[kind](document, "x.toml")
        except SpecError as error:
            counts["refused"] += 1
            check_line(str(error), "x.toml", document)
            return
        counts["taken"] += 1
        CHECK[kind](spec)

    run()
    assert min(counts.values()) > 10, counts  # both halves of the promise are tried


def leaves():
    """Kind of file, belt, and the route to each number in it."""
    for (kind, belt), text in GOOD.items():
        document = tomllib.loads(text)
        for route in tables(document):
            for key, value in at(document, route).items():
                if isinstance(value, int | float) and not isinstance(value, bool):
                    yield kind, belt, (*route, key)


def at(document, route):
    for key in route:
        document = document[key]
    return document


@pytest.mark.parametrize(("kind", "belt", "route"), list(leaves()), ids=lambda x: x[-1])
def test_every_number_of_a_file_is_bounded(kind, belt, route):
    for wrong in (1e308, -1e308, 10**60, 10**400, float("inf"), float("-inf"), float("nan"), "1"):
        document = tomllib.loads(GOOD[kind, belt])
        at(document, route[:-1])[route[-1]] = wrong
        with pytest.raises(SpecError) as refused:
            PARSE[kind](document, "x.toml")
        line = str(refused.value)
        check_line(line, "x.toml", document)
        named = ".".join(route) if len(route) < 3 else ".".join(route[:2])
        assert line.startswith(f"x.toml: {named}"), line


def test_every_range_has_ends():
    """Wide as they are: what is beyond them is what nobody means."""
    for allowed in (
        *SETTINGS.values(),
        *LIMITS.values(),
        *(entry.range for entry in PARAMETERS.values()),
    ):
        assert np.isfinite([allowed.low, allowed.high]).all() and not allowed.infinite


def test_samples_are_bounded_in_memory():
    document = tomllib.loads(GOOD["sweep", "steady"])
    document["run"]["samples"] = MOST_SAMPLES
    document["run"]["event_log"] = 2**16
    check_sweep(parse_sweep(document))
    document["run"]["samples"] = MOST_SAMPLES + 1
    with pytest.raises(SpecError, match=r"run.samples: must be a whole number in \[16, 1048576\]"):
        parse_sweep(document)


# --- text -----------------------------------------------------------------------------------------

CHUNKS = [
    "[", "]", "{", "}", "=", '"', "'", "\n", ".", ",", "#", "\x00", "\r", "é", "1e999", "-inf",
    "nan", "9" * 60, "9" * 5000, "0x" + "f" * 400, "[" * 5000, "{a=" * 2000,
    "a = " + "[" * 3000 + "]" * 3000,
    "a." * 2000 + "a = 1\n", "[" + "a." * 1500 + "a]\n", "1979-05-27T07:32:00Z", "'''", '"""',
    "\\ud800", "\\u0000", "[[axes]]\n", "[run]\n", "window = 1\n", "a" * 5000 + " = 1\n",
    "[sensitivities]\nzzz = 1\n", "true", "_", "+", "10" * 40,
]  # fmt: skip


@st.composite
def garbled(draw, kind):
    """The text of a file with one to three pieces put in, taken out or replaced."""
    text = GOOD[kind, draw(st.sampled_from(others(kind)))]
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(text)))
        length = draw(st.sampled_from([0, 0, 1, 1, 5, 20]))
        piece = draw(st.one_of(st.just(""), st.sampled_from(CHUNKS), st.text(max_size=3)))
        text = text[:at] + piece + text[at + length :]
    return text


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sweep", "scene"])
def test_garbled_files(kind, tmp_path):
    path = tmp_path / "x.toml"

    @OFTEN
    @given(garbled(kind))
    def run(text):
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        try:
            spec = LOAD[kind](path)
        except SpecError as error:
            said = str(error).removeprefix(f"{path}: ")
            assert said != str(error)
            assert len(said) < 300 and "\n" not in said and said.isprintable(), said
            return
        CHECK[kind](spec)

    run()


SEEN = {
    "[sensitivities]\nzzz = 1\n": "sensitivities.zzz: unknown key; must be one of parameters",
    "[run]\nsamples = "
    + "9" * 60
    + "\n": "run.samples: must be a whole number in [16, 1048576], was",
    "[run]\nsamples = " + "9" * 5000 + "\n": "must be written with fewer brackets within brackets",
    "a = " + "[" * 5000: "must be written with fewer brackets within brackets, and shorter numbers",
    "[classes]\nsqueal_band = [500, inf]\n": "classes.squeal_band.1: must be a finite number",
    "[classes]\nreversal_window = 1e308\n": (
        "classes.reversal_window: must lie inside [1e-09, 1000] s, was 1e+308"
    ),
    '[belt]\nkind = "wiping"\nfrequency = 1e-300\n': (
        "belt.frequency: must lie inside [0.0001, 1000] Hz, was 1e-300"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1, num = 10000000 }\n": (
        "axes.mu_static.num: must be a whole number in [1, 1000000], was 1e+07"
    ),
    "[axes]\nmu_static = { start = 1, stop = 1.0000000000000002, num = 5 }\n": (
        "axes.mu_static: values must increase or decrease, were too close to tell apart"
    ),
    "[blade]\n"
    + "k" * 5000
    + " = 1\n": f"blade.{'k' * 37}...: unknown key; must be one of tip_mass",
    'title = "a\\u0000b"\n': "title: must be one line of at most 500 printable characters, was",
    '[belt]\nkind = "wiping"\nfrequency = 20\n': (
        "classes.reversal_window: must be at most a fifth of the belt's period (0.01 s)"
    ),
}


@pytest.mark.parametrize(("text", "expected"), list(SEEN.items()), ids=lambda text: text[:24])
def test_what_was_seen(text, expected, tmp_path):
    """By name, what ended in a traceback, hung, or failed after the work."""
    path = tmp_path / "x.toml"
    rest = {
        "run": "[run]\ntransient = 0\nwindow = 1\n",
        "axes": "[axes]\ngravity = { values = [1] }\n",
    }
    if "[run]" in text:
        text += "transient = 0\nwindow = 1\n"
        del rest["run"]
    if "[axes]" in text:
        del rest["axes"]
    path.write_text(text + "\n" + "".join(rest.values()))
    with pytest.raises(SpecError) as refused:
        load_sweep(path)
    said = str(refused.value).removeprefix(f"{path}: ")
    assert said.startswith(expected)
    assert len(said) < 300 and "\n" not in said


def test_a_file_without_end_is_not_read(tmp_path):
    path = Path(tmp_path / "x.toml")
    path.write_text("# " + "a" * (4 * 10**6))
    with pytest.raises(SpecError, match=r"x.toml: must have at most 4 MB, had 4 MB$"):
        load_sweep(path)
