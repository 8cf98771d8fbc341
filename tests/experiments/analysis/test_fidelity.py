"""What the verdict says of the pace: how well the machine kept up with the wall clock."""

from __future__ import annotations

import pytest

from volery.agents.journal import Batch
from volery.agents.plan import Plan
from volery.experiments.analysis.fidelity import Fidelity, judge
from volery.experiments.record.record import Record

SECOND = 1_000_000_000


def judged(pace: str, speed: float | str, *behind_s: tuple[float, float]) -> Fidelity:
    """The verdict on ten seconds of agents that say how far behind they were, at most and at the end."""
    batches = {}
    for number, (most_s, end_s) in enumerate(behind_s):
        event = {"event": "done", "lateness_ns": [], "behind_ns": int(most_s * 1e9), "end_behind_ns": int(end_s * 1e9)}
        batches[str(number), 0] = Batch(str(number), 0, events=[event])
    events = ({"event": "finished", "time_ns": 10 * SECOND},)
    return judge(Record(Plan("p", 1, 10 * SECOND, (), {}), batches, events, {"pace": pace, "speed": speed}), (), {})


@pytest.mark.parametrize(
    ("speed", "behind_s", "words"),
    [
        (1.0, [(0.0031, 0.0), (0.0002, 0.0001)], "exact; by the wall clock within 4 ms"),
        (1.0, [(0.0, 0.0)], "exact; by the wall clock within 1 ms"),
        (
            1.0,
            [(3.1, 3.1), (0.2, 0.0)],
            "exact; the machine was at most 3.1 s behind, 3.1 s at the end: 0.76 × real time (try --speed 0.7)",
        ),
        (
            0.5,
            [(5.0, 5.0)],
            "exact; the machine was at most 5.0 s behind, 5.0 s at the end: 0.40 × real time (try --speed 0.3)",
        ),
        (
            2.0,
            [(0.2, 0.2)],
            "exact; the machine was at most 0.2 s behind, 0.2 s at the end: 1.92 × real time (try --speed 1.8)",
        ),
        (1.0, [(2.0, 0.01)], "exact; the machine was at most 2.0 s behind, 0.0 s at the end: 1.00 × real time"),
        (1.0, [], ""),
    ],
)
def test_exact_pace_says_how_far_behind_the_machine_was(
    speed: float, behind_s: list[tuple[float, float]], words: str
) -> None:
    """The worst of all agents; the advice is a speed at which the machine would have kept up."""
    fidelity = judged("exact", speed, *behind_s)
    assert fidelity.pace == words
    assert fidelity.as_asked


def test_lockstep_goes_by_no_clock() -> None:
    """So it cannot be behind; realtime pace says what was late instead."""
    assert judged("lockstep", "max", (0.0, 0.0)).pace == "exact; as fast as the machine could"
    assert judged("realtime", 1.0).pace == ""
