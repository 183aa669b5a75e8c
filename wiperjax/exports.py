"""A run for other programs: CSV for a table, MAT for MATLAB and the like, UFF 58 for test software;
and modes as UFF 55.

Samples over time with their units, in SI; events beside them where the format has a place.
"""

import csv
import io
import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.io
import xarray as xr

from .datasets.kinds import check_argument
from .datasets.run_dataset import axis_of, contact_axis
from .machine.files import check_output, replacing
from .noise.samples import sample_interval
from .vocabulary import checks
from .vocabulary.cf import flag_names

QUANTITIES = (
    *("position", "velocity", "output", "gap", "normal_force", "friction_force"),
    *("slip_speed", "belt_velocity", "regime"),
)
UFF_TYPE = {"position": 8, "velocity": 11, "output": 11, "gap": 8, "normal_force": 9,
            "friction_force": 9, "slip_speed": 11, "belt_velocity": 11}  # fmt: skip
"""Specific data type of dataset 58: 8 displacement, 9 excitation force, 11 velocity."""


def export(run: xr.Dataset, path: str | Path, force: bool = False) -> None:
    """Writes a run, or the modes of one system, in the format that the ending of `path` names, at
    once or not at all.

    - `.csv`: a line for each sample, `time (s)` first; the regime by its code, named in the head.
    - `.mat`: a variable for each quantity, `(samples,)`, those of the events, and `units`, of codes
        what each means. Letters that MATLAB's names cannot have are numbers: `position_u03c6`.
    - `.uff` or `.unv`: a dataset 58 for each quantity (time response, evenly spaced), each
        coordinate of a system of one's own a point of its own, and what is of the contact, or the
        output, at that of its coordinate, or at one more where it is none's; of modes
        (`wiperjax.modes`), which need this ending, a dataset 55 for each mode.

    Raises: `ValueError` for what is neither, another ending, or (UFF) samples that are not evenly
        spaced; `StoreError` if it exists (without `force`) or cannot be written.
    """
    checks.path("path", path)
    checks.flag("force", force)
    formats = FORMATS[check_argument("run", run, FORMATS)]
    ending = Path(path).suffix.lower()
    if ending not in formats:
        raise ValueError(f"{path}: must end in {' or '.join(formats)}")
    check_output(path, force)
    with replacing(path, force=force) as temporary:
        formats[ending](run, temporary)


def exported(run: xr.Dataset, ending: str) -> bytes:
    """What a file of this ending would hold of a run. Raises: as `export`."""
    with tempfile.TemporaryDirectory(prefix="wiperjax-") as folder:  # pyuff writes to names only
        path = Path(folder) / f"run{ending}"
        export(run, path)
        return path.read_bytes()


def columns(run: xr.Dataset) -> dict[str, tuple[np.ndarray, str]]:
    """Name -> (values over time, `_unit`) of a run; a vector is a column for each coordinate."""
    found = {"time": (np.asarray(run["time"], dtype=float), "s")}
    for name in QUANTITIES:
        if name not in run:
            continue
        values, unit = run[name], _unit(run[name])
        if values.ndim == 1:
            found[name] = (np.asarray(values), unit)
            continue
        for axis in run["axis"].values:
            found[f"{name}_{axis}"] = (np.asarray(values.sel(axis=axis), dtype=float), unit)
    return found


def _unit(variable: xr.DataArray) -> str:
    """Unit of a variable; of codes what each of them means."""
    if "flag_values" not in variable.attrs:
        return str(variable.attrs.get("units", ""))
    return "; ".join(f"{code} {name}" for code, name in flag_names(variable).items())


def _csv(run: xr.Dataset, path: Path) -> None:
    found = columns(run)
    head = io.StringIO()
    heads = [f"{name} ({unit})" if unit else name for name, (_, unit) in found.items()]
    csv.writer(head, lineterminator="").writerow(heads)  # a coordinate may have a comma in its name
    table = np.column_stack([values for values, _ in found.values()])
    form = ["%d" if values.dtype.kind in "iu" else "%.17g" for values, _ in found.values()]
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        np.savetxt(file, table, fmt=form, delimiter=",", header=head.getvalue(), comments="")


def _mat(run: xr.Dataset, path: Path) -> None:
    found = {_identifier(name): column for name, column in columns(run).items()}
    events = {str(n): np.asarray(run[n]) for n in run.data_vars if run[n].dims == ("event",)}
    units = {name: unit for name, (_, unit) in found.items()}
    units |= {name: _unit(run[name]) for name in events}
    held = {name: values for name, (values, _) in found.items()} | events
    units = {name: unit for name, unit in units.items() if unit}
    about = {"title": str(run.attrs.get("title", "")), "units": units}
    with open(path, "wb") as file:  # by its name scipy would add an ending
        scipy.io.savemat(file, held | about, oned_as="column", long_field_names=True)


def _identifier(name: str) -> str:
    """A name as a variable of MATLAB may have it: other letters by their number."""
    return re.sub(r"\W", lambda letter: f"u{ord(letter[0]):04x}", name, flags=re.ASCII)


def _uff(run: xr.Dataset, path: Path) -> None:
    step, found = sample_interval(run), columns(run)
    time = found.pop("time")[0]
    title = str(run.attrs.get("title", "")) or "run of wiperjax"
    axes = [str(axis) for axis in run["axis"].values] if "axis" in run else []
    # as of modes: of x and y one point, else a point for each coordinate
    plane = {*axes} <= {"x", "y"}
    nodes = {axis: 1 if plane else number for number, axis in enumerate(axes, 1)}

    def beside(axis: int | None) -> int:
        return 1 if plane else 1 + (len(axes) if axis is None else axis)

    contact = beside(contact_axis(run))
    output = beside(axis_of(run, run["output"])) if "output" in run else contact
    sets = []
    for name, (values, unit) in found.items():
        base = next((base for base in UFF_TYPE if name == base or name.startswith(f"{base}_")), "")
        if not base:
            continue
        axis = name.removeprefix(f"{base}_")
        direction = 2 if axis == "y" or name in ("normal_force", "gap") else 1
        node = nodes.get(axis, output if base == "output" else contact)
        sets.append(
            {
                "type": 58, "func_type": 1, "rsp_node": node, "rsp_dir": direction,
                "ref_node": node, "ref_dir": direction, "data": values.astype(float), "x": time,
                "id1": _line(name),
                "id2": _line(title), "rsp_ent_name": "TIP", "ref_ent_name": "TIP",
                "abscissa_spacing": 1, "abscissa_min": time[0], "abscissa_inc": step,
                "num_pts": len(time), "ord_data_type": 4, "abscissa_spec_data_type": 17,
                "abscissa_axis_lab": "Time", "abscissa_axis_units_lab": "s",
                "ordinate_spec_data_type": UFF_TYPE[base], "ordinate_axis_lab": _line(name, 20),
                "ordinate_axis_units_lab": _line(unit, 20), "orddenom_spec_data_type": 0,
            }
        )  # fmt: skip
    _write_sets(sets, path)


def _uff_modes(modes: xr.Dataset, path: Path) -> None:
    """Of a system with the two coordinates x and y one point, else a point for each coordinate."""
    plane = [str(name) for name in modes["axis"].values] == ["x", "y"]
    sets = []
    for number in modes["mode"].values:
        one = modes.sel(mode=number)
        shape = np.asarray(one["shape_amplitude"]) * np.exp(1j * np.asarray(one["shape_phase"]))
        eigenvalue = complex(float(one["real_part"]), 2 * np.pi * float(one["frequency"]))
        first, second = (shape[:1], shape[1:]) if plane else (shape, 0 * shape)
        sets.append(
            {
                "type": 55, "model_type": 1, "analysis_type": 3, "data_ch": 2, "spec_data_type": 8,
                "load_case": 0, "mode_n": int(number), "eig": eigenvalue, "r1": first,
                "r2": second, "r3": 0 * first, "node_nums": np.arange(1, len(first) + 1),
                "id1": f"mode {int(number)} of steady sliding", "id2": "wiperjax",
            }
        )  # fmt: skip
    _write_sets(sets, path)


def _write_sets(sets: list[dict], path: Path) -> None:
    try:
        import pyuff  # the format has its own kept writer; needed for this ending only
    except ImportError:
        raise ValueError("universal files need pyuff: pip install pyuff") from None
    try:
        pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    except Exception as error:  # of a full disk it says only that it could not write
        if isinstance(error.__context__, OSError):
            raise error.__context__ from None
        raise


def _line(text: str, length: int = 80) -> str:
    """Text as the format holds it: ASCII, on one short line; other letters by their number."""
    return " ".join(text.encode("ascii", "backslashreplace").decode().split())[:length] or "NONE"


FORMATS: dict[str, dict[str, Callable[[xr.Dataset, Path], None]]] = {
    "run": {".csv": _csv, ".mat": _mat, ".uff": _uff, ".unv": _uff},
    "modes": {".uff": _uff_modes, ".unv": _uff_modes},
}
"""What is written of each kind, by the ending of the file."""
