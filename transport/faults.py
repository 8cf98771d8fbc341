"""Faults as data: what changes, where and when. No code of an agent or a link depends on a fault's name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from ..errors import BadInput
from .links import NANOSECONDS, LinkSettings

LinkName = tuple[str, str]


@dataclass(frozen=True)
class _Span:
    """A name, and the span [at, until) in which a fault is active; `until_ns` None: until cleared."""

    id: str
    at_ns: int
    until_ns: int | None

    def in_force(self, now_ns: int) -> bool:
        """Whether the fault is active at an instant."""
        return self.at_ns <= now_ns and (self.until_ns is None or now_ns < self.until_ns)


@dataclass(frozen=True)
class LinkFault(_Span):
    """Changed settings of some directed links in [at, until); `until_ns` None: until cleared."""

    links: tuple[LinkName, ...]
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class Kill(_Span):
    """An agent handles all events before `at_ns`, then its process is killed; it restarts at `until_ns`, if given.

    `keep_state`: the next incarnation starts with the saved state, as from non-volatile memory.
    """

    agent: str
    keep_state: bool = False


@dataclass(frozen=True)
class Pause(_Span):
    """An agent's processor is stopped in [at, until); its events wait, in order."""

    agent: str


@dataclass(frozen=True)
class Hog(_Span):
    """Another process takes a share of an agent's processor in [at, until); in realtime pace only."""

    agent: str
    share: float = 1.0

    def __post_init__(self) -> None:
        """Check the bound."""
        if not 0 < self.share <= 1:
            raise BadInput(f"share is {self.share:g}, it must be above 0 and at most 1")


@dataclass(frozen=True)
class ClockFault(_Span):
    """An agent's local clock reads t + offset + (t − at)·drift // 10⁹ in [at, until); drift in parts per 10⁹."""

    agent: str
    offset_ns: int = 0
    drift_ppb: int = 0

    def __post_init__(self) -> None:
        """Check that the clock does not run backwards."""
        if self.drift_ppb <= -NANOSECONDS:
            raise BadInput(f"drift is {self.drift_ppb} ppb, it must be above −10⁹: a clock does not go back")


SensorTrouble = Literal["failed", "stuck", "bias", "noise", "spikes"]


@dataclass(frozen=True)
class SensorFault(_Span):
    """A fault of a sensor that affects samples taken in [at, until).

    failed: no samples. stuck: the last sample before `at` is repeated. bias: `size` is added. noise: normal noise of
    standard deviation `size` is added. spikes: with `probability`, ±`size` is added.
    `size` has one component, or as many as the sensor.
    """

    agent: str
    sensor: str
    trouble: SensorTrouble
    size: tuple[float, ...] = ()
    probability: float = 1.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not 0 <= self.probability <= 1:
            raise BadInput(f"probability is {self.probability:g}, it must lie between 0 and 1")
        if (self.trouble in ("bias", "noise", "spikes")) != bool(self.size):
            raise BadInput(f"{self.trouble} {'needs a' if not self.size else 'takes no'} size")


Fault = LinkFault | Kill | Pause | Hog | ClockFault | SensorFault


def in_force(faults: Iterable[Fault], now_ns: int) -> dict[str, Fault]:
    """The faults that are active at an instant, by id."""
    return {fault.id: fault for fault in faults if fault.in_force(now_ns)}


def kills_of(faults: Iterable[Fault], agent: str) -> list[Kill]:
    """The kills of one agent in the order of time; its n-th restart is incarnation n."""
    kills = [fault for fault in faults if isinstance(fault, Kill) and fault.agent == agent]
    return sorted(kills, key=lambda kill: kill.at_ns)


def effective(base: LinkSettings, link: LinkName, faults: Iterable[LinkFault], now_ns: int) -> LinkSettings:
    """The settings of a link at an instant, with the active faults applied in the order of their starts."""
    touching = [fault for fault in faults if link in fault.links and fault.in_force(now_ns)]
    changes: dict[str, Any] = {}
    for fault in sorted(touching, key=lambda fault: (fault.at_ns, fault.id)):
        changes.update(fault.changes)
    return replace(base, **changes) if changes else base
