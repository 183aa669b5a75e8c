"""What the commands print: short tables of what a file holds and what it took."""

import sys
import time
from datetime import timedelta
from pathlib import Path
from typing import Any

DISAGREE = 1e-3  # median of the checked cells: what is called fine is right to that
CHANGED = 0.1  # share of the checked cells: what is called fine unchecked is not, as often


def print_plan(spec: Any, cores: int, finer: Any) -> None:
    """Axes with their units, so that a wrong unit is seen before hours are spent on it, and what it
    will take, with a refinement of the settings `finer` (None: with none).
    """
    from ..maps.estimate import words
    from ..specs.refine import parse_refine

    known = spec.parameter_table
    for name, values in spec.axes_values().items():
        unit = "" if known[name].edge_unit == "1" else f"{known[name].edge_unit} "
        print(f"{name:<17} {values[0]:g} ... {values[-1]:g} {unit}({values.size} values)")
    print(f"{'cells':<17} {words(spec, cores)}")
    if finer is not None:
        print(f"{'borders':<17} at most {parse_refine(finer, spec).max_cells} points more")
    print_notes(spec)


def print_notes(spec: Any) -> None:
    """What is allowed in a sweep or a scene, but rarely meant."""
    for note in spec.notes():
        print(f"note: {note}", file=sys.stderr)


def print_map(dataset: Any) -> None:
    """Classes, what is open, derivatives and events of a map that was made just now."""
    print_classes(dataset)
    print_open(dataset)
    print_sensitivities(dataset)
    print_events(dataset)


def print_classes(dataset: Any) -> None:
    """Classes of a map, counted; of several starts, of each named one, and what hangs on them."""
    from ..datasets.map_starts import failed_somewhere, hangs_on_start
    from ..noise.class_counts import class_table

    print(f"{'class':<12}{counted(dataset):>9}{'share':>9}")
    for name, count, share in class_table(dataset):
        if name == "not_computed":  # of an unfinished sweep: has no share
            continue
        print(f"{name:<12}{count:>9}{share:>9.1%}")
    several = hangs_on_start(dataset)
    if several is None:
        return
    named = "class_share" not in dataset and "start" in dataset.sizes  # else one was taken
    for start in dataset["start"].values if named else ():
        rows = class_table(dataset.sel(start=start))
        shares = ", ".join(f"{name} {share:.1%}" for name, count, share in rows if count)
        print(f"start {start}: {shares}")
    done = int((dataset["class_set"] >= 0).sum())
    print(f"the class depends on the start in {int(several.sum())} of {done} cells")
    if failed := int(failed_somewhere(dataset).sum()):
        print(f"some starts failed in {failed} of {done} cells; a failure is no class")


def print_open(dataset: Any) -> None:
    """How many answers of a map are not the last word: failed, no frequency, no settled motion."""
    from ..noise.class_counts import failures, lifted_count, unsettled_count, untold_count
    from ..vocabulary.codes import ADVICE, RESULTS, Result

    for name, count in failures(dataset):
        why = ADVICE[Result(RESULTS[name])] if name in RESULTS else "a code of another version"
        if name == "finished":
            why = "but without numbers that its class rests on"
        print(f"failed       {count} {counted(dataset, count)}: {name}, {why}")
    if fast := untold_count(dataset):
        why = "carried, too fast for the finest samples, or of no two periods"
        print(f"not told     {fast} {counted(dataset, fast)}: {why}")
    if lost := unsettled_count(dataset):
        why = "growing, dying, irregular or of too few periods"
        print(f"not settled  {lost} {counted(dataset, lost)}: {why}")
    if lifted := lifted_count(dataset):
        why = "held on the glass where the lip would leave it; sweep --model lip has its motion"
        print(f"lifted       {lifted} {counted(dataset, lifted)}: {why}")


def print_anatomy(dataset: Any) -> None:
    """What the motions that have no name of their own are made of, if the map says it."""
    from ..noise.class_counts import anatomy

    if "mechanism" in dataset and "band" in dataset:
        for mechanism, band, count in anatomy(dataset):
            print(f"other: {count} {counted(dataset, count)} of {mechanism}, band {band}")


def counted(dataset: Any, count: int = 0) -> str:
    """What is counted in a map, a `count` of it: its runs, where each cell has several."""
    one = "run" if "start" in dataset.sizes else "cell"
    return one if count == 1 else f"{one}s"


def print_class(run: Any) -> None:
    """Class and frequency of a run, or why its samples tell none."""
    import numpy as np

    from ..noise.run_class import assess, why_no_frequency, words
    from ..vocabulary.codes import BANDS, LABELS

    try:
        found = assess(run)
    except ValueError as error:
        print(f"{'label':<12}not known: {error}")
        return
    for name, word in words(found).items():
        print(f"{name:<12}{word}")
    frequency, label = float(found["dominant_frequency"]), int(found["label"])
    pitch = f"{frequency:.4g} Hz"
    if label == LABELS["failed"] or np.isnan(frequency) and label != LABELS["quiet"]:
        pitch = f"not known: {why_no_frequency(found)}"
    elif int(found["band"]) == BANDS["none"]:  # rounding has a strongest line, too
        pitch = "none: no tone"
    print(f"{'frequency':<12}{pitch}")


def print_end(run: Any) -> None:
    """A note if a run did not reach its end, and why; nothing else."""
    from ..vocabulary.codes import RESULTS, result_name

    if (code := int(run.get("result", RESULTS["finished"]))) != RESULTS["finished"]:
        where = f"{float(run['final_time']):.4g} of {float(run.attrs['duration']):.4g} s"
        known = code in RESULTS.values()  # of another the message is that of another end
        how = f"{result_name(code)}: {run.result_message}" if known else f"with {result_name(code)}"
        print(f"note: the run ended at {where}, {how}", file=sys.stderr)


def print_attributes(dataset: Any) -> None:
    """How a file was made, as far as it says; texts of several lines indented."""
    print()
    for name, value in dataset.attrs.items():
        lines = str(value).splitlines()
        if not lines or name in ("specification", "specification_canonical"):  # for machines
            continue
        if len(lines) > 1:
            print(f"{name}:", *(f"    {line}" for line in lines), sep="\n")
        else:
            print(f"{name}: {value}")


def print_sensitivities(dataset: Any) -> None:
    """Where derivatives hold, and how those that were checked agree with central differences."""
    if "sensitivity_code" not in dataset:
        return
    import numpy as np

    from ..noise.class_counts import cut_count
    from ..vocabulary.cf import flag_names

    codes, counts = dataset["sensitivity_code"], {}
    cells = max(int(codes.notnull().sum()), 1)  # `ds.where` may have taken others out
    for code, name in flag_names(codes).items():
        counts[name] = int((codes == code).sum())
        print(f"derivatives {name:<20}{counts[name]:>9}{counts[name] / cells:>9.1%}")
    found = dataset["sensitivity_agreement"].values
    found = found[np.isfinite(found)]
    if found.size:
        print(
            f"checked by differences: {found.size} cells; the worst derivative of each differs by "
            f"{np.median(found):.1e} (median), {found.max():.1e} (largest)"
        )
        if np.median(found) > DISAGREE:  # smooth systems: 1e-6 (docs/gradients.md, "Accuracy")
            why = "have the law of friction, the belt or the forces corners that they do not tell"
            print(f"note: derivatives disagree with differences: {why}?", file=sys.stderr)
    changed, unchecked = counts["sequence_changes"], counts["fine"] - found.size
    checked = found.size + changed
    if unchecked and changed > CHANGED * checked:
        events = f"{changed} of {checked} checked cells have other events a step away"
        rest = f"as large a share of the {unchecked} that are called fine unchecked"
        print(f"note: {events}; so, most likely, {rest}: see all with check = 1", file=sys.stderr)
    if "label" in dataset and (cut := cut_count(dataset)):
        of = f"derivatives of {cut} noisy cells, which did not come back to themselves, are those"
        print(f"note: {of} of a window that cuts them (docs/gradients.md)", file=sys.stderr)


def print_events(dataset: Any) -> None:
    """What the event log of a map holds and what it had no room for."""
    if "event_count" not in dataset:
        return
    count, room = dataset["event_count"].values, dataset.sizes["event"]
    count = count[count >= 0]  # cells that are computed
    if not count.size:
        return
    cut = int((dataset["event_overflow"].values == 1).sum())
    print(f"events: {count.sum(dtype=int)} in the settled windows, {count.max()} in the fullest;")
    of = counted(dataset, count.size)
    print(f"    the log has room for {room} of each, {cut} of {count.size} {of} had more")


def print_special(branch: Any) -> None:
    """Special points of a branch of cycles, why it ends, and what of it is not known well."""
    import numpy as np

    from ..datasets.branch_dataset import EXACT, simulations
    from ..vocabulary.codes import FAIR

    over = branch.attrs["over"]
    unit = branch[over].attrs["units"]
    for kind, value, detail in zip(
        *(branch[f"special_{key}"].values for key in ("kind", "parameter", "detail")), strict=True
    ):
        print(f"{over} {value:.6g} {unit}: {str(kind).replace('_', ' ')} ({detail})")
    stable = branch["stable"].values.astype(bool)
    print(f"cycles   {stable.sum()} stable, {(~stable).sum()} unstable")
    inexact = branch["trivial_error"].values > EXACT  # NaN of what is driven: it has no such one
    if inexact.any():
        most = float(branch["trivial_error"].max())
        known = f"multipliers of {inexact.sum()} cycles are known to {most:.0e} only"
        print(f"note: {known} (trivial_error)", file=sys.stderr)
    print(f"ends     {branch.attrs['ends']}")
    if (simulated := simulations(branch)) is not None:
        ended, repeats = simulated["result"].values, simulated["repeat_time"].values
        went_on = np.isin(ended, FAIR)
        print(f"simulated {went_on.sum()} of {ended.size} motions to their end")
        if alone := (went_on & np.isnan(repeats)).sum():
            means = (
                f"{alone} of them did not come back to themselves: their means are over the window"
            )
            print(f"note: {means} (repeat_time)", file=sys.stderr)


def print_curves(branch: Any) -> None:
    """Curves in two parameters: how long each is, its special points, and why it ends."""
    from ..datasets.branch_dataset import curves
    from ..vocabulary.cf import flag_names

    held = curves(branch)
    if held is None:
        return
    names = [held.attrs["over"], held.attrs["second"]]
    units = [held[name].attrs.get("units", "") for name in names]
    codes = flag_names(held["end_code"])

    def place(point: int) -> str:
        values = (f"{float(held[name][point]):.6g}" for name in names)
        return ", ".join(f"{n} {v} {u}" for n, v, u in zip(names, values, units, strict=True))

    first = 0
    sizes = zip(held["kind"].values, held["row_size"].values, strict=True)
    for k, (kind, size) in enumerate(sizes):
        print(f"curve    {str(kind).replace('_', ' ')}: {size} points")
        for point, end in ((first, 0), (first + int(size) - 1, 1)):
            code, why = codes[int(held["end_code"][k, end])], str(held["end_detail"][k, end].values)
            print(f"    ends at {place(point)}: {why}{' (failed)' if code == 'failed' else ''}")
        for j in range(held.sizes["special"]):
            if int(held["special_curve"][j]) == k:
                what, why = (str(held[f"special_{key}"].values[j]) for key in ("kind", "detail"))
                where = place(int(held["special_point"][j]))
                print(f"    {where}: {what.replace('_', ' ')} ({why})")
        first += int(size)


def print_phases(dataset: Any) -> None:
    """What the time of a sweep went into."""
    from ..machine.provenance import PHASES

    seconds = {name: float(dataset.attrs.get(f"{name}_time", 0.0)) for name in PHASES}
    if any(seconds.values()):
        idle = seconds.pop("idle")
        parts = ", ".join(f"{name} {value:.1f} s" for name, value in seconds.items())
        print(f"time     {parts}; cores idle for {idle:.1f} s of it")


def cost(output: Path, begun: float) -> str:
    """What a file took: its size, the time since `begun`, and the most memory of this process."""
    from ..machine.memory import peak_memory

    elapsed = timedelta(seconds=round(time.monotonic() - begun))
    size, memory = output.stat().st_size / 1e6, peak_memory() / 1e9
    return f"{size:.3g} MB, {elapsed}, {memory:.2f} GB of memory"
