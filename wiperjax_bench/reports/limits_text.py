"""The text under the stability limits, from their data."""

import numpy as np
import xarray as xr

from .words import versions


def limits_text(dataset: xr.Dataset, picture: str) -> str:
    """Return Markdown: the picture, measured over theory, and how it was measured."""
    lines = ["# Largest stable step", "", f"![step over stiffness]({picture})", ""]
    lines += [
        "Lines: theory, from the method's stability function and the eigenvalues of the motion. "
        "Marks: measured, by bisection over fixed steps. Open marks at the top: no limit found up "
        "to 100 times the fastest time constant. Kvaerno5's root search (diffrax's VeryChord) says "
        "that it diverges once the disturbance is down to rounding: that is not counted as growth.",
        "",
        "| problem | method | measured over theory |",
        "|---|---|---|",
    ]
    for problem in dataset.problem.values:
        for method in dataset.solver.values:
            theory = dataset.theory.sel(problem=problem, solver=method).values
            measured = dataset.measured.sel(problem=problem, solver=method).values
            if np.all(np.isnan(measured)):
                continue
            both = np.isfinite(theory) & np.isfinite(measured)
            if both.any():
                ratio = measured[both] / theory[both]
                text = f"{ratio.min():.3f} to {ratio.max():.3f}"
            else:
                text = ""
            unlimited = np.isinf(measured) & np.isinf(theory)
            if unlimited.any():
                text = f"{text} unlimited in both ({unlimited.sum()} points)".strip()
            other = np.isinf(measured) != np.isinf(theory)
            if other.any():
                at = ", ".join(f"{x:.0e}" for x in measured[other])
                text += f"; theory unlimited, measured {at} s ({other.sum()} points)"
            lines.append(f"| {problem} | {method} | {text} |")
    lines += ["", f"{dataset.attrs['machine']}. " + versions(dataset), ""]
    return "\n".join(lines)
