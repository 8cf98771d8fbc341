"""Agents that only send, and two that read the clock, as only benchmarks may."""

from __future__ import annotations

import time
from dataclasses import dataclass

from volery.agents.agent import Agent, Received, Timer
from volery.units import period_ns


@dataclass(frozen=True)
class PulseParameters:
    """`rate` in Hz of sends to every neighbour, `phase_ns` of the first, `size` of a payload in bytes.

    `begin_ns` and `end_ns` bound the measurement.
    """

    rate: float
    phase_ns: int
    size: int
    begin_ns: int = 0
    end_ns: int = 0


class Pulse(Agent):
    """Sends the same payload to every neighbour periodically, and ignores what it receives."""

    Parameters = PulseParameters
    timers_only = True
    parameters: PulseParameters

    def start(self) -> None:
        """Set the first timer."""
        self.payload = b"x" * self.parameters.size
        self.context.set_timer(self.parameters.phase_ns, "pulse", 0)

    def on_timer(self, timer: Timer) -> None:
        """Send, and set the timer for the next period."""
        for neighbour in self.context.neighbours:
            self.context.send(neighbour, self.payload)
        index = timer.index + 1
        self.context.set_timer(self.parameters.phase_ns + period_ns(self.parameters.rate, index), "pulse", index)


class Stopwatch(Pulse):
    """A pulse that reports `error` of each frame: the monotonic clock when it is handled minus its due time [ns]."""

    def start(self) -> None:
        """Also set the timer of the report."""
        super().start()
        self.errors: list[int] = []
        self.context.set_timer(self.parameters.end_ns, "report")

    def on_frame(self, frame: Received) -> None:
        """Read the clock first."""
        now = time.monotonic_ns()
        if frame.time_ns >= self.parameters.begin_ns:
            self.errors.append(now - frame.time_ns)

    def on_timer(self, timer: Timer) -> None:
        """Send, or report."""
        if timer.name == "report":
            self.context.report("error", self.errors)
        else:
            super().on_timer(timer)


class Meter(Pulse):
    """A pulse that reports the processor time of its process, of all threads, and its number of handled frames."""

    def start(self) -> None:
        """Also set the timers of the measurement."""
        super().start()
        self.frames = 0
        self.context.set_timer(self.parameters.begin_ns, "begin")
        self.context.set_timer(self.parameters.end_ns, "end")

    def on_frame(self, frame: Received) -> None:
        """Count."""
        self.frames += 1

    def on_timer(self, timer: Timer) -> None:
        """Send, or read the processor time."""
        if timer.name == "begin":
            self.before = (time.process_time(), self.frames)
        elif timer.name == "end":
            cpu_s, frames = self.before
            self.context.report("meter", [time.process_time() - cpu_s, self.frames - frames])
        else:
            super().on_timer(timer)
