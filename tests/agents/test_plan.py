"""Plans: what an engine may ask of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.plan import AgentPlan, Plan, moving
from volery.errors import BadInput
from volery.experiments.scenario.load import load_scenario

PLACES = {"1": (0.0, 0.0), "2": (3.0, 4.0), "3": None}


class Drifting:
    """Agent n moves along the x axis at n metres per second."""

    moves: ClassVar[bool] = True

    def sensors(self, agent: str) -> Mapping[str, float]:
        """None."""
        return {}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """Nothing."""
        return None

    def position(self, agent: str, time_ns: int) -> NDArray[np.float64]:
        """Where it is."""
        return np.array([float(agent) * time_ns / 1e9, 0.0])


def plan(world: Drifting | None) -> Plan:
    """Three agents, two of them with places."""
    agents = tuple(AgentPlan(name, "beacon", None, (), {}, place) for name, place in PLACES.items())
    return Plan("apart", 1, 10**9, agents, {}, world)


def test_agents_are_as_far_apart_as_their_places() -> None:
    """Euclidean distance in metres, the same at all times where nothing moves."""
    assert plan(None).distance_m("1", "2", 0) == plan(None).distance_m("2", "1", 10**9) == 5.0


def test_where_the_world_moves_it_says_how_far() -> None:
    """Places of the topology no longer count, and the distance changes with time."""
    assert [plan(Drifting()).distance_m("1", "3", second * 10**9) for second in range(3)] == [0.0, 2.0, 4.0]


def test_agents_without_places_have_no_distance() -> None:
    """The message names both."""
    with pytest.raises(BadInput, match="agents 2 and 3 have no positions"):
        plan(None).distance_m("2", "3", 0)


def test_a_target_does_not_take_the_agents_places() -> None:
    """The `position` of a target's world is how far off it may begin: nobody moves, and agents stay where they are."""
    tracked = load_scenario("tracker").plan
    places = {agent.name: agent.position for agent in tracked.agents}
    assert moving(tracked.world) is None
    assert moving(Drifting()) is not None
    assert places["1"] is not None
    assert places["2"] is not None
    assert tracked.distance_m("1", "2", 0) == math.dist(places["1"], places["2"])
