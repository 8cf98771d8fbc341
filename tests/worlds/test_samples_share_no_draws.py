"""Noise is independent from sample to sample: no two samples of a world use one draw."""

from __future__ import annotations

import pytest

from volery.experiments.scenario.load import load_scenario
from volery.randomness import Stream

Draw = tuple[int, int]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> set[Draw]:
    """Key of its stream and index of every draw since it was cleared last."""
    found: set[Draw] = set()
    uniform = Stream.uniform

    def noted(self: Stream, index: int) -> float:
        found.add((self._key, index))
        return uniform(self, index)

    def one_by_one(self: Stream, first: int, count: int) -> list[float]:
        return [self.normal(first + further) for further in range(count)]

    monkeypatch.setattr(Stream, "uniform", noted)
    monkeypatch.setattr(Stream, "normals", one_by_one)
    return found


@pytest.mark.parametrize(
    "name", ["altitude-obstacles", "attitude3", "beacons-moving", "dfa-kalman", "mhe-roll", "tracker"]
)
def test_samples_share_no_draws(name: str, drawn: set[Draw]) -> None:
    """Of one sensor or several, of one agent or several; what is drawn once for all is drawn with the first sample."""
    plan = load_scenario(name).plan
    assert plan.world is not None
    owner: dict[Draw, tuple[str, str, int]] = {}
    for agent in plan.agents[:3]:
        for sensor in plan.world.sensors(agent.name):
            for index in range(7):
                drawn.clear()
                plan.world.measure(agent.name, sensor, index)
                for draw in drawn if index else ():
                    sample = agent.name, sensor, index
                    assert owner.setdefault(draw, sample) == sample
    assert owner
