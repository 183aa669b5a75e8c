"""The pages: the model agrees with the code, the API pages name everything public, code runs."""

import ast
import importlib
import importlib.util
import re
import sys
import tomllib
import types
from pathlib import Path

import numpy as np
import pytest
from pages import CHECKOUT, DOCS, DOORS, PAGES, as_params, blocks, write_files

import wiperjax
from wiperjax.cli import main
from wiperjax.vocabulary.parameters import PARAMETERS

SOURCES = [f for name in ("wiperjax", "wiperjax_bench") for f in CHECKOUT.glob(f"{name}/**/*.py")]


def test_files_that_texts_name_exist():
    named = r"\b(?:wiperjax|wiperjax_bench|tests|docs|sweeps)/[\w/]+\.(?:py|md|toml)\b"
    gone = {
        f"{text.name}: {name}"
        for text in (*PAGES, *SOURCES)
        for name in re.findall(named, text.read_text())
        if "NAME" not in name and not (CHECKOUT / name).exists()
    }
    assert gone == set()


# --- the model ------------------------------------------------------------------------------------


def section(number: int) -> str:
    text = (DOCS / "model.md").read_text()
    (found,) = re.findall(rf"^## {number}\. .*?(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return found


def test_the_table_of_parameters_is_that_of_the_code():
    rows = [line.strip("| \n").split(" | ") for line in section(9).splitlines() if "| `" in line]
    table = {name.strip("`"): (symbol, value, unit) for symbol, name, value, unit in rows}
    assert list(table) == list(PARAMETERS)
    for name, (symbol, value, unit) in table.items():
        parameter = PARAMETERS[name]
        assert unit == parameter.unit, name
        assert (None if value == "-" else float(value.split()[0])) == parameter.reference, name
        plain = symbol.strip("$").replace("{", "").replace("}", "").replace("\\", "")
        plain = re.sub(r"^var", "", plain).replace("_varphi", "_phi")
        same = {"k_1": "k1", "k_2": "k2", "N_0": "N0", "V_0": "V0"}
        assert same.get(plain, plain) == parameter.symbol, name


def test_code_cites_sections_that_the_model_has():
    have = {int(n) for n in re.findall(r"^## (\d+)\. ", (DOCS / "model.md").read_text(), re.M)}
    assert have == set(range(1, 12))
    cited = set()
    for file in (CHECKOUT / "wiperjax").rglob("*.py"):
        for first, last in re.findall(
            r"model\.md,? sections? (\d+)(?: to (\d+))?", file.read_text()
        ):
            cited |= {int(first), int(last or first)}
    assert cited and cited <= have


def test_the_page_of_keys_is_that_of_the_tables():
    spec = importlib.util.spec_from_file_location("keys", DOCS / "keys.py")
    assert spec is not None and spec.loader is not None
    keys = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(keys)
    assert (DOCS / "keys.md").read_text() == keys.page(), "run python docs/keys.py"
    # what lies inside a range and is refused all the same is said, too
    assert keys.limits(PARAMETERS["belt_speed"]).endswith("m/s, 1e-06 or more in size")
    assert keys.limits(PARAMETERS["shoulder_angle"]).endswith("which would be radians")


def test_help_names_the_unit_of_every_parameter_of_the_blade():
    text = wiperjax.Wiper.__doc__
    for name, entry in PARAMETERS.items():
        if entry.table == "blade":
            unit = "" if entry.unit == "1" else f" [{entry.unit}]"
            assert f"\n        {name}: {entry.long_name}{unit}, {entry.reference:.6g}\n" in text


# --- the API --------------------------------------------------------------------------------------


def public(module: str) -> set[str]:
    """Names that a module hands on: its `__all__`, or what it defines and imports as itself."""
    loaded = importlib.import_module(module)
    if (stated := getattr(loaded, "__all__", None)) is not None:
        return set(stated)
    names = set()
    for node in ast.parse(Path(str(loaded.__file__)).read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.ImportFrom) and node.level:
            own = module == "wiperjax"  # the face gives other names to some
            names |= {a.asname for a in node.names if a.asname and (own or a.asname == a.name)}
    return {name for name in names if not name.startswith("_")}


@pytest.mark.parametrize("door", DOORS)
def test_the_api_pages_name_everything_public(door):
    text = "\n".join(page.read_text() for page in (DOCS / "api").glob("*.md"))
    named = set(re.findall(r"^::: (\S+)$", text, re.MULTILINE))
    assert {f"{door}.{name}" for name in public(door)} <= named
    for each in named:  # and nothing that is not there
        module, _, name = each.rpartition(".")
        assert hasattr(importlib.import_module(module), name), each


# --- the code in the pages ------------------------------------------------------------------------


def those_with(language: str, *, run: bool = False) -> list:
    found = [page for page in PAGES if blocks(page, language)]
    assert found
    return as_params(found, run=run)


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A folder with a small map under the names that pages use."""
    folder = tmp_path_factory.mktemp("maps")
    spec = wiperjax.parse_sweep(
        {
            "axes": {
                "attack_angle": {"values": [-20, 5]},
                "normal_load": {"values": [15]},
                "belt_speed": {"values": [0.2, 0.3]},
            },
            "run": {"transient": 0.02, "window": 0.05, "event_log": 12, "raster": 20},
        }
    )
    wiperjax.sweep(spec, folder / "MAP.h5")
    (folder / "reference.h5").write_bytes((folder / "MAP.h5").read_bytes())
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("page", those_with("python", run=True))
def test_python_runs(page, maps, monkeypatch):
    """Block after block, as a reader would; `__name__` is not `__main__`, so scripts for a queue of
    jobs, whose library is not installed here, are compiled and their imports checked, no more."""
    import matplotlib
    import matplotlib.pyplot as plt
    from matplotlib.collections import QuadMesh

    matplotlib.use("Agg")
    plt.close("all")  # `.plot()` draws into the current figure: not into another test's
    monkeypatch.chdir(maps)
    queue = types.ModuleType("dask_jobqueue")
    queue.SLURMCluster = None  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "dask_jobqueue", queue)
    write_files(page, maps)
    monkeypatch.syspath_prepend(maps)
    names = {"__name__": "page", "__file__": str(maps / "page.py"), "wiperjax": wiperjax, "np": np}
    for block in blocks(page, "python"):
        exec(compile(block, str(page), "exec"), names)
    for mesh in (c for n in plt.get_fignums() for ax in plt.figure(n).axes for c in ax.collections):
        if isinstance(mesh, QuadMesh) and (values := mesh.get_array()) is not None:
            assert np.ptp(values) > 0, "a picture of one colour shows nothing"


@pytest.mark.parametrize("page", those_with("toml"))
def test_tables_of_sweep_files_are_understood(page, tmp_path, monkeypatch):
    write_files(page, tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    whole = {
        "axes": {"attack_angle": {"values": [-20, 5]}},
        "run": {"transient": 0.1, "window": 0.1},
    }
    for block in blocks(page, "toml"):
        given = tomllib.loads(block)
        run = whole["run"] | given.get("run", {})
        if "duration" in run:
            wiperjax.parse_scene(given)
            continue
        spec = wiperjax.parse_sweep(whole | given | {"run": run})
        assert spec.axes_values()


@pytest.mark.parametrize("page", those_with("sh"))
def test_commands_and_their_options_exist(page, capsys):
    for line in "\n".join(blocks(page, "sh")).replace("\\\n", " ").splitlines():
        command = re.search(r"(?:^|/|\s)wiperjax ((?:bench )?[a-z]+)([^#]*)", line)
        if not command:
            continue
        assert main([*command[1].split(), "--help"]) == 0, line
        text = capsys.readouterr().out
        for option in re.findall(r"(?<=\s)--?[a-z-]+", command[2].split("&&")[0]):
            assert option in text, f"{line}: {option}"
