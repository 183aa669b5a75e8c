"""What a sweep shows of its progress."""

import numpy as np
from stub_sweep import make_spec, run


def test_progress_is_silent_without_a_terminal_and_counts_with_one(tmp_path, capfd):
    from io import StringIO

    from rich.console import Console

    from wiperjax.maps.progress import Report

    run(make_spec(), tmp_path / "map.h5", progress=True)
    assert capfd.readouterr() == ("", "")
    screen = StringIO()
    console = Console(file=screen, force_terminal=True, width=150)
    with Report(100, title="stub", console=console) as report:
        report.update(
            {"label": np.array([0] * 30 + [1] * 20), "result": np.zeros(50, dtype=int)}, 50, 0.9
        )
    said = screen.getvalue()
    assert "50 of 100 cells" in said and "quiet 30, squeal 20" in said and "finished 50" in said
    assert "occupancy 90%" in said and "cells/s" in said and "left" in said
