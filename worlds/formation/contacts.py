"""Contacts of vehicles with each other and with the ground: start and end of each. They do not affect the motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...rotation_columns import norms
from .formation_description import FormationDescription

Floats = NDArray[np.float64]


class Contacts:
    """The present contacts, updated at discrete instants."""

    def __init__(self, world: FormationDescription) -> None:
        self._agents = world.agents
        self._nearest = 2.0 * world.vehicle.radius
        self._ground = world.ground
        self._first, self._second = np.triu_indices(len(world.agents), 1)
        self._touching = np.zeros(len(self._first), dtype=bool)
        self._grounded = np.zeros(len(world.agents), dtype=bool)
        self._events: list[dict[str, Any]] = []

    def look(self, places: Floats, time_ns: int) -> None:
        """Note contacts that began or ended since the last call.

        Vehicles collide while they are closer than two radii: events "collision" and "collision over", with both names
        and their distance. One is on the ground while its centre is below height 0: "ground" and "ground over".

        Args:
            places: (3, N) [m].
            time_ns: now.
        """
        distances = norms(places[:, self._first] - places[:, self._second])
        touching = distances < self._nearest
        for pair in np.flatnonzero(touching != self._touching).tolist():
            agents = [self._agents[self._first[pair]], self._agents[self._second[pair]]]
            self._note("collision", bool(touching[pair]), time_ns, agents, distance_m=float(distances[pair]))
        self._touching = touching
        if self._ground:
            grounded = places[2] < 0.0
            for number in np.flatnonzero(grounded != self._grounded).tolist():
                height = float(places[2, number])
                self._note("ground", bool(grounded[number]), time_ns, [self._agents[number]], height_m=height)
            self._grounded = grounded

    def told(self) -> list[dict[str, Any]]:
        """The events since the last call."""
        events, self._events = self._events, []
        return events

    def _note(self, event: str, begins: bool, time_ns: int, agents: list[str], **size: float) -> None:
        name = event if begins else f"{event} over"
        self._events.append({"event": name, "time_ns": time_ns, "agents": agents, **size})
