"""Agents that do nothing but talk, and two that look at the clock, which only a benchmark may."""

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
    """Sends the same payload to every neighbour, again and again; what it hears it forgets."""

    Parameters = PulseParameters
    timers_only = True
    parameters: PulseParameters

    def start(self) -> None:
        """Set the first timer."""
        self.payload = b"x" * self.parameters.size
        self.context.set_timer(self.parameters.phase_ns, "pulse", 0)

    def on_timer(self, timer: Timer) -> None:
        """Send, and come back a period later."""
        for neighbour in self.context.neighbours:
            self.context.send(neighbour, self.payload)
        index = timer.index + 1
        self.context.set_timer(self.parameters.phase_ns + period_ns(self.parameters.rate, index), "pulse", index)


class Stopwatch(Pulse):
    """A pulse that notes when each frame is handled: `error` is the monotonic clock minus the due time, in ns."""

    def start(self) -> None:
        """Set the timer of the report too."""
        super().start()
        self.errors: list[int] = []
        self.context.set_timer(self.parameters.end_ns, "report")

    def on_frame(self, frame: Received) -> None:
        """Look at the clock first."""
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
    """A pulse that reports the processor time of its process, all threads, and the frames that it handled meanwhile."""

    def start(self) -> None:
        """Set the timers of the measurement too."""
        super().start()
        self.frames = 0
        self.context.set_timer(self.parameters.begin_ns, "begin")
        self.context.set_timer(self.parameters.end_ns, "end")

    def on_frame(self, frame: Received) -> None:
        """Count."""
        self.frames += 1

    def on_timer(self, timer: Timer) -> None:
        """Send, or look at the meter."""
        if timer.name == "begin":
            self.before = (time.process_time(), self.frames)
        elif timer.name == "end":
            cpu_s, frames = self.before
            self.context.report("meter", [time.process_time() - cpu_s, self.frames - frames])
        else:
            super().on_timer(timer)
