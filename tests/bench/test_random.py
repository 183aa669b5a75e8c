"""Random blades: each can be drawn again, and the referee tells right events from wrong ones."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("numba", reason="bench needs numba")

from wiperjax.vocabulary.codes import Event, Result  # noqa: E402
from wiperjax.vocabulary.parameters import PARAMETERS  # noqa: E402
from wiperjax_bench.measurements.referee import Referee  # noqa: E402
from wiperjax_bench.scenes import wide  # noqa: E402

REFERENCE = Path(__file__).parents[1] / "helpers" / "reference"


@pytest.mark.parametrize("group", range(len(wide.GROUPS)))
def test_blades_are_drawn_again_and_are_allowed(group):
    drawn = wide.draw(group, 1, 7, 500)
    again = wide.draw(group, 1, 7, 500)
    np.testing.assert_equal(drawn._asdict(), again._asdict())
    other = wide.draw(group, 1, 8, 500)
    assert np.all(drawn.blade["normal_load"] != other.blade["normal_load"])
    for name, values in drawn.blade.items():
        parameter = PARAMETERS[name]
        assert parameter.problem(parameter.to_edge(values)) is None
    assert {0.0, 0.9, 0.99, 1.0} < set(drawn.blade["restitution"])
    assert np.all(np.abs(drawn.start[:, 0]) < drawn.blade["lip_length"])
    assert np.all(drawn.start[:, 1] >= 0)


@pytest.fixture(scope="module")
def judged():
    """A referee, blades, one of them, and the reference's events of it as an engine logs them."""
    referee = Referee(REFERENCE, 2e-3, 1e-6)
    drawn = wide.draw(0, 1, 0, 16)
    seen = ((i, referee.seen(drawn, i).events) for i in range(16))
    place, events = next((i, e) for i, e in seen if len(e) > 3)
    kinds = {kind.name.lower(): int(kind) for kind in Event}
    assert events[-1][1] == "finished"
    return referee, drawn, place, [[t, kinds[k], b, a] for t, k, b, a in events[:-1]]


def test_the_referee_knows_right_from_wrong(judged):
    referee, drawn, place, log = judged

    def say(events, code=Result.FINISHED):
        return referee.verdict(drawn, place, events, code)[0]

    assert say(log) == "same"
    assert say(log[:-1]) == "different"
    assert say([*log[:-2], log[-1]]) == "different"
    assert say([*log, [2e-3, int(Event.KINK), 1, 1]]) == "different"
    assert say(log, Result.COLLAPSED) == "different"
    assert say(log, Result.PAINLEVE_INDETERMINATE) == "different"
    assert say(log, Result.STEP_TOO_SMALL) == "failed"


def test_the_reference_says_that_several_motions_were_possible(judged, monkeypatch):
    referee, drawn, place, log = judged
    simulate = referee.code.simulate

    def flagged(*args, **options):
        run = simulate(*args, **options)
        run.flags.append((0.0, "indeterminate"))
        return run

    monkeypatch.setattr(referee.code, "simulate", flagged)
    say = lambda code, events=log: referee.verdict(drawn, place, events, code)[0]
    assert say(Result.PAINLEVE_INDETERMINATE) == "same"
    assert say(Result.FINISHED) == "different"
    others = [*log[:-1], [log[-1][0], int(Event.KINK), 1, 1]]
    assert say(Result.PAINLEVE_INDETERMINATE, others) == "one of several"
    assert say(Result.FINISHED, others) == "different"


def test_events_before_several_motions_are_possible_are_not_excused(judged, monkeypatch):
    referee, drawn, place, log = judged
    simulate = referee.code.simulate

    def flagged(*args, **options):
        run = simulate(*args, **options)
        run.flags.append((2e-3, "indeterminate"))
        return run

    monkeypatch.setattr(referee.code, "simulate", flagged)
    others = [*log[:-1], [log[-1][0], int(Event.KINK), 1, 1]]
    code = Result.PAINLEVE_INDETERMINATE
    assert referee.verdict(drawn, place, others, code)[0] == "different"


def test_a_folder_without_the_reference_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"--reference must be a folder with blade\.py"):
        Referee(tmp_path, 1e-3, 1e-6)
