"""Certification counts all that departs, and says whose it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

import volery
from volery.agents.journal import Batch, Measured
from volery.experiments import verify as certification
from volery.experiments.record.record import Life


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Half a second of four modules in the twin."""
    return volery.run("dfa4", overrides=["duration=500 ms"], engine="twin", runs=tmp_path).folder


def verdict_on(folder: Path, monkeypatch: pytest.MonkeyPatch, *changed: Batch) -> certification.Verdict:
    """What is said of a run whose replay has some batches otherwise than its record."""
    replay = certification.replay

    def otherwise(*arguments: object) -> Mapping[Life, Batch]:
        batches = {(batch.agent, batch.incarnation): batch for batch in changed}
        return {**replay(*arguments), **batches}  # type: ignore[arg-type]

    monkeypatch.setattr(certification, "replay", otherwise)
    return certification.verify(folder)


def test_all_that_departs_is_counted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the first of each agent: two estimates of 2, one that 4 has not, and a frame at both of its ends."""
    record = volery.load(folder).record
    second, fourth = record.batches["2", 0], record.batches["4", 0]
    estimates = [one._replace(value=[-number for number in one.value]) for one in second.estimates[:2]]
    frame = next(heard for heard in fourth.heard if heard.source == "2")
    lost = [one._replace(verdict="loss") if one[:2] == ("4", frame.sequence) else one for one in second.sent]
    verdict = verdict_on(
        folder,
        monkeypatch,
        Batch("2", 0, [*estimates, *second.estimates[2:]], lost, second.heard, second.dropped),
        Batch(
            "4",
            0,
            fourth.estimates[1:],
            fourth.sent,
            [one._replace(fate="loss") if one == frame else one for one in fourth.heard],
            fourth.dropped,
        ),
    )
    all_estimates = sum(len(batch.estimates) for batch in record.batches.values())
    all_frames = sum(len(batch.sent) + len(batch.dropped) for batch in record.batches.values())
    assert (verdict.certified, verdict.exit_code) == (False, 3)
    assert verdict.lines[0] == (
        f"not certified: 1 of {all_frames:,} frame fates and 3 of {all_estimates} estimates "
        "of agents 2 and 4 depart from the twin"
    )
    start_ns = next(one.start_ns for one in second.sent if one[:2] == ("4", frame.sequence))
    first = f"first departure at {start_ns / 1e9:.6f} s: agent 2 sent frame {frame.sequence} to 4: "
    assert verdict.lines[1].startswith(first)


def test_what_the_twin_has_not_departs(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A life that the replay does not know departs as a whole."""
    mine = volery.load(folder).record.batches["3", 0]
    verdict = verdict_on(folder, monkeypatch, Batch("3", 0, [], mine.sent, mine.heard, mine.dropped))
    assert f" and {len(mine.estimates)} of " in verdict.lines[0]
    assert "of agent 3 depart" in verdict.lines[0]
    assert "recorded, nothing in the twin" in verdict.lines[1]


def test_the_same_run_is_certified(folder: Path) -> None:
    """Every estimate and every frame's fate, bit for bit."""
    verdict = certification.verify(folder)
    assert verdict.certified
    assert verdict.lines[0].startswith("certified: ")


def test_what_was_measured_from_a_frame_is_compared(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A measurement that only the twin has departs."""
    mine = volery.load(folder).record.batches["3", 0]
    frame = mine.heard[0]
    seen = Measured(frame.due_ns, frame.source, frame.incarnation, frame.sequence, frame.copy, [2.5])
    verdict = verdict_on(folder, monkeypatch, replace(mine, measured=[seen]))
    assert not verdict.certified
    what = f"agent 3 measured from frame {frame.sequence} from {frame.source}: nothing recorded, [2.5] in the twin"
    assert verdict.lines[1] == f"first departure at {frame.due_ns / 1e9:.6f} s: {what}"
