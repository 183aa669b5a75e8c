"""Writes `keys.md`, every key of a sweep and of a scene file: `python docs/keys.py`.

All of it stands in the tables that check the files, in their docstrings and ranges; a test holds
the page to them.
"""

import dataclasses
import inspect
import re
import typing
from pathlib import Path

from pydantic_core import PydanticUndefined

from wiperjax.specs.axis import Axis
from wiperjax.specs.refine import Refine
from wiperjax.specs.scene import SceneSpec
from wiperjax.specs.sensitivities import Sensitivities
from wiperjax.specs.starts import Starts
from wiperjax.specs.sweep import SweepSpec
from wiperjax.specs.tables import ALLOWED, Classes, SceneRun, Start, SweepRun, Table
from wiperjax.vocabulary.kinds import BELTS, FRICTIONS
from wiperjax.vocabulary.parameters import PARAMETERS, Parameter

HEAD = """# Every key of a sweep and of a scene file

Made by `python docs/keys.py` from the tables that check the files. Angles are degrees, all else SI
units, per metre of blade. A table or key without "must be given" may be left out. Examples:
`wiperjax example`.

"""
TOP = {
    "title": "a line that headings of pictures bear",
    "system": 'import path "module:Class" of [a system of your own](your_own_system.md)',
    "model": 'which rung of the [ladder](ladder.md) stands for the blade; `"auto"`, of a sweep '
    "only: [the poorest that does](maps.md#which-model)",
}


def page() -> str:
    """The text of the page."""
    axes = "A sweep only; must be given. Each key is a parameter of `[blade]`, or `belt_speed`, "
    axes += "`belt_frequency`, `belt_ramp`, `belt_phase` of the belt; each value one of\n"
    axes += (
        "`{ start = 1, stop = 12, num = 12 }`, the same with `spacing`, or `{ values = [1, 2] }`. "
    )
    axes += "The last axis varies fastest.\n\n"
    texts = [
        HEAD,
        "## At the top\n\n" + table(SweepSpec, tuple(TOP), TOP),
        "## [axes]\n\n" + axes + table(Axis),
        "## [blade]\n\nAttack angle and lengths are drawn in [the model](model.md). "
        + laws() + "\n\n"
        + parameters({name: p for name, p in PARAMETERS.items() if p.table == "blade"}),
        "## [parameters]\n\nThose that [a system, or a friction law, of your own]"
        "(your_own_system.md) declares; and, of such a system, `friction`, the name of its law. In "
        "place of `[blade]`, unless it is the law of a wiper.\n",
        "## [belt]\n\n`kind`: `steady` (if left out), `wiping` (a sine) or `trapezoid`. A "
        "measured one runs from Python ([how](your_own_system.md#measured-points)).\n",
        *(
            f'### kind = "{kind}"\n\n' + parameters({k: PARAMETERS[n] for k, n in keys.items()})
            for kind, keys in BELTS.items()
        ),
        "## [start]\n\n" + words(Start) + "\n\n" + table(Start),
        "## [run] of a sweep\n\n" + words(SweepRun) + "\n\n" + table(SweepRun),
        "## [run] of a scene\n\n" + words(SceneRun) + "\n\n" + table(SceneRun),
        "## [classes]\n\n" + words(Classes) + " [Classes](classes.md) explains them.\n\n"
        + table(Classes),
        "## [sensitivities]\n\nA sweep only. " + words(Sensitivities)
        + " [Gradients](gradients.md) explains them.\n\n" + table(Sensitivities),
        "## [starts]\n\nA sweep only. " + words(Starts)
        + " [Maps](maps.md#more-than-one-answer) explains them.\n\n" + table(Starts),
        "## [refine]\n\nA sweep only. " + words(Refine)
        + " [Borders](maps.md#borders) explains it.\n\n" + table(Refine),
    ]  # fmt: skip
    assert set(SweepSpec.model_fields) | set(SceneSpec.model_fields) == {
        *TOP, "axes", "blade", "given", "belt", "start", "run", "classes", "sensitivities",
        "starts", "refine",
    }  # fmt: skip
    return "\n".join(text.rstrip() + "\n" for text in texts)


def laws() -> str:
    """The key `friction`, and which numbers each law has."""
    each = (
        f"`{kind}` ({', '.join(f'`{name}`' for name in keys.values())})"
        for kind, keys in FRICTIONS.items()
    )
    return f"`friction`: {' or '.join(each)}; if left out, the first."


def parameters(shown: dict[str, Parameter]) -> str:
    """Keys of the blade or the belt."""
    lines = ["| key | what | if left out | range |", "|---|---|---|---|"]
    for key, p in shown.items():
        reference = "must be given" if p.reference is None else f"{p.to_edge(p.reference):.6g}"
        lines.append(f"| `{key}` | {p.long_name} | {reference} | {limits(p)} |")
    return "\n".join(lines) + "\n"


def limits(p: Parameter) -> str:
    """Range of a parameter with its unit in files."""
    unit = "" if p.unit == "1" else p.edge_unit
    must = dataclasses.replace(p.range, unit=unit).must.removeprefix("must ").removeprefix("lie ")
    must = must.removeprefix("be ")
    if p.smallest:
        must += f", {p.smallest:g} or more in size"
    if p.never_small:
        must += ", not all 1.57 or less, which would be radians"
    return must


def table(model: type[Table], keys: tuple[str, ...] = (), meant: dict[str, str] | None = None):
    """Keys of one of the tables, or some of them."""
    meant = meant or attributes(model)
    lines = ["| key | what | if left out | must be |", "|---|---|---|---|"]
    for name, field in model.model_fields.items():
        if keys and name not in keys:
            continue
        default = "must be given" if field.default is PydanticUndefined else shown(field.default)
        row = (f"`{field.alias or name}`", meant[name], default, allowed(name, field.annotation))
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


def allowed(name: str, annotation: typing.Any) -> str:
    """What a value must be, in the words of its error line."""
    if type(None) in (choices := typing.get_args(annotation)):  # may be left out
        return allowed(name, choices[0])
    if typing.get_origin(annotation) is typing.Literal:
        return " or ".join(f'`"{choice}"`' for choice in typing.get_args(annotation))
    if typing.get_origin(annotation) is dict:
        return "a table of axis = [low, high]"
    if name in ("position", "velocity"):
        each = "pairs [from, to]" if "list" in str(annotation) else "numbers"
        return f"{each}, one a coordinate"
    if name not in ALLOWED:
        return "a list of names" if "list" in str(annotation) else "text"
    must = ALLOWED[name].must.removeprefix("must ").removeprefix("be ")
    many = "two numbers, each " if "tuple" in str(annotation) else ""
    return many + must.removeprefix("lie ")


def shown(default: typing.Any) -> str:
    """A default as it would stand in a file."""
    if default is None or default in ("", {}):
        return "-"
    if isinstance(default, list | tuple):
        return f"`[{', '.join(map(shown, default))}]`".replace("``", "").replace("[`", "[")
    return f'"{default}"' if isinstance(default, str) else f"{default:g}"


def attributes(model: type[Table]) -> dict[str, str]:
    """Key -> what it is, from the docstring (a scene has some from `SweepRun`)."""
    _, _, listed = inspect.cleandoc(model.__doc__ or "").partition("Attributes:\n")
    found = attributes(SweepRun) if model is SceneRun else {}
    for keys, text in re.findall(r"^    ([\w, ]+): (.*(?:\n     .*)*)", listed, re.MULTILINE):
        plain = " ".join(text.split()).rstrip(".")
        found |= {key.strip(): plain for key in keys.split(",")}
    return found


def words(model: type[Table]) -> str:
    """What a table is, the first paragraph of its docstring."""
    return " ".join(inspect.cleandoc(model.__doc__ or "").partition("\n\n")[0].split())


if __name__ == "__main__":
    Path(__file__).with_suffix(".md").write_text(page(), encoding="utf-8")
