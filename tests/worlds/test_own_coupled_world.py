"""Worlds of users' own that agents act upon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from volery.agents.agent import Agent, Sample
from volery.errors import VoleryError
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.quantities import Floats
from volery.randomness import Stream
from volery.worlds.world import RunningWorld, World


class Carts(World):
    """Carts that are pushed."""

    truth_rate = 20.0

    def sensors(self, agent: str) -> Mapping[str, Any]:
        """At a rate, and once."""
        return {"place": 10.0, "start": [0]}

    def begin(self) -> RunningWorld:
        """At rest."""
        return RunningCarts(self.agents)


class RunningCarts(RunningWorld):
    """Places."""

    def __init__(self, agents: Sequence[str]) -> None:
        self.places = dict.fromkeys(agents, 0.0)

    def act(self, agent: str, command: str, value: Floats) -> None:
        """Move it."""
        if command != "move":
            super().act(agent, command, value)
        self.places[agent] += value[0]

    def measure(self, agent: str, sensor: str, index: int) -> Any:
        """Where it is."""
        return self.places[agent]

    def truth(self) -> Mapping[str, Any]:
        """All places."""
        return {"positions": [(place, 0.0) for place in self.places.values()]}


class Hearing(Carts):
    """Cannot be."""

    def measure_frame(self, source: str, target: str, time_ns: int, noise: Stream) -> Any:
        """Nothing."""
        return 0.0


class VagueCarts(RunningCarts):
    """Says where carts are in words."""

    def truth(self) -> Any:
        """No number."""
        return {"cart@1": "far"}


class Vague(Carts):
    """Its truth is none."""

    def begin(self) -> RunningWorld:
        """Such a run."""
        return VagueCarts(self.agents)


class Slow(Carts):
    """Has no delay."""

    act_delay_ns = 0


class Pusher(Agent):
    """Pushes its cart by its own number at every sample."""

    command = "move"

    def on_sample(self, sample: Sample) -> None:
        """Push."""
        if sample.sensor == "place":
            self.context.report("cart", sample.value or 0.0, sample.index)
            self.context.command({self.command: float(self.context.name)})


class Puller(Pusher):
    """Knows another command."""

    command = "pull"


def run(world: type[World], agent: type[Agent]) -> Record:
    """Three agents in a world, in the twin."""
    fields = {
        "name": "carts",
        "duration": "500 ms",
        "topology": {"complete": 3},
        "agents": {"kind": f"{__name__}:{agent.__name__}"},
        "world": {"kind": f"{__name__}:{world.__name__}"},
        "links": {"latency": "5 ms"},
    }
    return recorded(load_scenario(fields).plan)


def test_agents_act_upon_a_world_of_ones_own() -> None:
    """Commands take effect; samples at rates and instants; places are drawn from "positions"."""
    record = run(Carts, Pusher)
    assert record.estimates("cart")["2"].value[:, 0].tolist() == [0, 2, 4, 6, 8]
    assert [one.sensor for one in record.batches["1", 0].samples].count("start") == 1
    assert record.evaluated.places is not None
    assert record.evaluated.places.places[-1].tolist() == [[5, 0], [10, 0], [15, 0]]


@pytest.mark.parametrize(
    ("world", "agent", "message"),
    [
        (Hearing, Pusher, "world .*:Hearing: measure_frame cannot be"),
        (Vague, Pusher, "world .*:Vague: truth\\(\\) has for 'cart@1' 'far': return numbers"),
        (Slow, Pusher, "world .*:Slow: act_delay_ns is 0: it must be whole nanoseconds, at least 1"),
        (Carts, Puller, r"world .*:Carts: act\('1', 'pull', .*failed: the world takes no command 'pull' of agent 1"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(world: type[World], agent: type[Agent], message: str) -> None:
    """Measuring frames, delays, and commands."""
    with pytest.raises(VoleryError, match=message):
        run(world, agent)
