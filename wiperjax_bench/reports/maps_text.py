"""The text of `wiperjax bench maps`: classes and variables of a map, by setting, and their cost."""

import xarray as xr

from ..measurements.maps import COMPARED
from .words import versions

SHORT = dict(zip(COMPARED, ("stick fraction", "slip fraction", "flight fraction", "rms velocity",
                 "mean force", "greatest force", "frequency"), strict=True))  # fmt: skip


def text(dataset: xr.Dataset, picture: str) -> str:
    """Return the table as Markdown."""
    lines = [
        "# Classes of a map, and its variables, by setting",
        "",
        f"![error of what a map stores over its cost]({picture})",
        "",
        f"{dataset.attrs['cells']} random cells of the reference sweep, 0.8 s each. On "
        f"{dataset.attrs['undecided']:.2%} of them the two references "
        f"({dataset.attrs['references']}) give different classes (chaos, or an edge between "
        "classes); all columns but the first share leave those out. The first reference is what "
        "errors are taken against: 90th percentile over "
        "the cells, relative to the variable's 90th percentile.",
        "",
        "| code | solver | precision | rtol | class differs | of decided cells | failed | "
        + " | ".join(SHORT.values())
        + " | trial steps | cells a second of a core |",
        "|---" * (9 + len(SHORT)) + "|",
    ]
    for i in range(dataset.sizes["row"]):
        r = {k: v.item() for k, v in dataset.isel(row=i).items()}
        errors = " | ".join(f"{r[f'{name}_p90']:.1e}" for name in COMPARED)
        lines.append(
            f"| {r['code']} | {r['solver']} | {r['precision']} | {r['rtol']:.0e} | "
            f"{r['wrong']:.2%} | {r['wrong_settled']:.2%} | {r['failed']:.2%} | {errors} | "
            f"{r['steps']:.0f} | {1 / r['cpu']:.0f} |"
        )
    return "\n".join(
        [
            *lines,
            "",
            f"{dataset.attrs['machine']}, {dataset.attrs['created']}, load average "
            f"{dataset.attrs['load']:.1f} at the end. {versions(dataset)}",
            "",
        ]
    )
