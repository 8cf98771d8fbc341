"""Agents that talk and that answer, and a world for them to look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from volery.agents.agent import Agent, Received, Sample, Timer
from volery.units import period_ns

_LONGEST = 40


@dataclass(frozen=True)
class TalkerParameters:
    """How often an agent talks, in Hz, how late in its period, in nanoseconds, and whether to all at once."""

    rate: float = 40.0
    phase_ns: int = 0
    broadcast: bool = False


class Talker(Agent):
    """Keeps a sum that depends on all that it saw and on the order, and tells it in frames of changing length."""

    Parameters = TalkerParameters
    timers_only = True
    parameters: TalkerParameters

    def start(self) -> None:
        """Begin with a number of its own."""
        self.sum = crc32(self.context.name.encode())
        self._lengths = self.context.random("lengths")
        self._told = 0
        self._set(int(self.context.now_ns * self.parameters.rate / 1e9) + 1)

    def _set(self, count: int) -> None:
        time_ns = period_ns(self.parameters.rate, count) + self.parameters.phase_ns
        self.context.set_timer(time_ns, index=count)

    def save(self) -> Any:
        """The sum, and how much was told."""
        return [self.sum, self._told]

    def restore(self, state: Any) -> None:
        """Go on with the sum, and with the lengths where they were."""
        self.sum, self._told = state

    def note(self, *seen: object) -> None:
        """Take something in."""
        self.sum = crc32(repr((self.sum, seen)).encode())

    def tell(self, target: str) -> None:
        """Send the sum, padded, to a neighbour of now."""
        if target not in self.context.neighbours:
            return
        length = 4 + int((_LONGEST - 3) * self._lengths.uniform(self._told))
        self._told += 1
        self.context.send(target, self.sum.to_bytes(4, "little").ljust(length, b"."), stream=f"s{self._told % 2}")

    def on_sample(self, sample: Sample) -> None:
        """Note it, and tell one neighbour now and then."""
        self.note(sample.sensor, sample.index, sample.time_ns, None if sample.value is None else sample.value.tolist())
        if sample.index % 3 == 0 and self.context.neighbours:
            self.tell(self.context.neighbours[sample.index % len(self.context.neighbours)])

    def on_timer(self, timer: Timer) -> None:
        """Report, and tell everybody."""
        self.note(timer.index)
        self.context.report("sum", [float(self.sum)], timer.index)
        if self.parameters.broadcast:
            self.context.broadcast(self.sum.to_bytes(4, "little"), "all")
        for neighbour in self.context.neighbours[: 1 if self.parameters.broadcast else None]:
            self.tell(neighbour)
        self._set(timer.index + 1)

    def on_frame(self, frame: Received) -> None:
        """Note who told what, and when."""
        self.note(frame.source, frame.payload, frame.time_ns)


class Listener(Talker):
    """Never sends anything, and reports whenever it has heard something."""

    def start(self) -> None:
        """Begin with nothing, and without timers."""
        self.sum = 0

    def on_frame(self, frame: Received) -> None:
        """Note it."""
        super().on_frame(frame)
        self.context.report("sum", [float(self.sum)], -1)


class Answerer(Talker):
    """A talker that answers: at once to most frames, after a while to the rest."""

    timers_only = False

    def on_frame(self, frame: Received) -> None:
        """Note it and answer, unless the sum says that it is enough."""
        super().on_frame(frame)
        self.context.report("sum", [float(self.sum)], -1)
        if self.sum % 8 < 4:
            self.tell(frame.source)
        elif self.sum % 8 == 4:
            self.context.set_timer(self.context.now_ns + 1_700_000, frame.source)

    def on_timer(self, timer: Timer) -> None:
        """The answer of before, or the usual."""
        if timer.name:
            self.tell(timer.name)
        else:
            super().on_timer(timer)


@dataclass(frozen=True)
class Probe:
    """A world with one sensor; it sees its own count, and nothing every fifth time."""

    rate: float = 50.0

    def sensors(self, agent: str) -> Mapping[str, float]:
        """One for each agent."""
        return {"probe": self.rate}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The count."""
        return None if index % 5 == 4 else np.array([float(index)])

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """Nothing true here."""
        return np.zeros(1)
