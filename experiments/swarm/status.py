"""What is going on in a running swarm, from what its agents tell: for the progress display and `volery status`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...agents.journal import Batch
from ...transport.faults import LinkName
from ...transport.links import DELIVERED


@dataclass
class Status:
    """Counts so far, the links on which a frame was heard, and the estimates last heard of.

    `agents`: their names. `alive`: whose processes live, a coupled world that runs beside the agents included.
    """

    duration_ns: int
    agents: frozenset[str]
    time_ns: int = 0
    alive: set[str] = field(default_factory=set)
    frames: int = 0
    lost: int = 0
    late: int = 0
    latest: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)
    used: set[LinkName] = field(default_factory=set)

    def take(self, batch: Batch, now_ns: int) -> None:
        """Count the entries of a batch."""
        self.time_ns = max(self.time_ns, now_ns)
        self.frames += len(batch.heard)
        self.lost += sum(1 for entry in batch.heard if entry.fate != DELIVERED) + len(batch.dropped)
        self.late += len(batch.late)
        self.used.update((entry.source, batch.agent) for entry in batch.heard)
        for estimate in batch.estimates:
            self.latest.setdefault(estimate.quantity, {})[batch.agent] = estimate.value

    def disagreement(self) -> float | None:
        """Largest distance of a living agent's newest estimate from their mean; None with fewer than two."""
        for latest in self.latest.values():
            values = [value for agent, value in latest.items() if agent in self.alive]
            if len(values) > 1 and len({len(value) for value in values}) == 1:
                array = np.array(values)
                return float(np.linalg.norm(array - array.mean(axis=0), axis=1).max())
        return None

    def to_dict(self) -> dict[str, Any]:
        """Plain values for `volery status`."""
        return {
            "time_s": self.time_ns / 1e9,
            "duration_s": self.duration_ns / 1e9,
            "agents": len(self.agents),
            "alive": sorted(self.alive & self.agents),
            "frames": self.frames,
            "lost": self.lost,
            "late": self.late,
            "disagreement": self.disagreement(),
            "faults": self.faults,
        }
