"""The journal of an agent's process: estimates, samples, what became of frames. The record is made of these batches.

Entries are tuples of plain values, so that they travel as MessagePack and are kept as JSON without loss.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from .agent import Sample

LAST_HEARD = "last-heard"
"""Event: how many transmissions of an incarnation that was killed externally have come."""

MISSED = "missed"
"""Event: samples or commands were lost by the middleware on a wire."""
NOTED = "noted"
"""Event: something happened that an agent, or a coupled world, had to say."""


class Estimate(NamedTuple):
    """A quantity that an agent reported: `sample` is the one it belongs to, `value` a flat vector."""

    time_ns: int
    quantity: str
    sample: int
    value: list[float]


class Taken(NamedTuple):
    """A sample that an agent took, in nominal time: its value flat and its shape, both None where nothing was seen."""

    sensor: str
    sample: int
    time_ns: int
    shape: list[int] | None
    value: list[float] | None

    @classmethod
    def of(cls, sample: Sample) -> Taken:
        """The entry of a sample whose stamp is nominal."""
        if (value := sample.value) is None:
            return cls(sample.sensor, sample.index, sample.time_ns, None, None)
        return cls(sample.sensor, sample.index, sample.time_ns, list(value.shape), value.ravel().tolist())


class Commanded(NamedTuple):
    """A command of an agent that took effect on a coupled world; `value` is flat."""

    time_ns: int
    agent: str
    command: str
    value: list[float]


class Payload(NamedTuple):
    """What a frame brought that was delivered, in hexadecimal digits; written down where an evaluation asks for it."""

    time_ns: int
    source: str
    content: str


class Measured(NamedTuple):
    """What an agent measured from a frame that was delivered to it at `time_ns`; `value` is None where nothing was."""

    time_ns: int
    source: str
    incarnation: int
    sequence: int
    copy: int
    value: list[float] | None


class Sent(NamedTuple):
    """A transmission as its sender saw it; `verdict`: delivered, cut, loss or corrupt; `copy` is 1 for a duplicate."""

    target: str
    sequence: int
    size: int
    start_ns: int
    airtime_ns: int
    due_ns: int
    verdict: str
    copy: int = 0


class Heard(NamedTuple):
    """A frame at its receiver, with its final fate; `incarnation` is the sender's."""

    source: str
    incarnation: int
    sequence: int
    due_ns: int
    fate: str
    copy: int = 0


class Dropped(NamedTuple):
    """A frame that never reached the air: `cause` is refused (over the MTU), queue, or access (given up)."""

    target: str
    sequence: int
    time_ns: int
    cause: str


class Late(NamedTuple):
    """A frame that came after its agent had handled something later; `behind_ns` says by how much."""

    source: str
    incarnation: int
    sequence: int
    due_ns: int
    behind_ns: int
    copy: int = 0


class Released(NamedTuple):
    """A frame that its link held back until `time_ns`, when it was let go."""

    source: str
    incarnation: int
    sequence: int
    time_ns: int
    copy: int = 0


class Arrived(NamedTuple):
    """When a frame really came to the process of its receiver, and when it was handed over.

    In realtime pace only, by the wall clock as nominal time.
    """

    source: str
    incarnation: int
    sequence: int
    arrived_ns: int
    handed_ns: int
    copy: int = 0


FRAME_ROWS: dict[str, Any] = {
    "sent": Sent,
    "heard": Heard,
    "dropped": Dropped,
    "late": Late,
    "released": Released,
    "arrived": Arrived,
}
"""The lists of a batch that speak of frames, and the kind of their rows."""
FACT_ROWS: dict[str, Any] = {"samples": Taken, "commands": Commanded, "payloads": Payload, "measured": Measured}
"""Those that the evaluation of a run lives on."""
ENTRIES: dict[str, Any] = {"estimates": Estimate, **FRAME_ROWS, **FACT_ROWS}
"""All of them; the events of a batch are mappings."""


@dataclass
class Batch:
    """The entries of one agent and incarnation since the last batch, each list in the order of its events."""

    agent: str
    incarnation: int
    estimates: list[Estimate] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    heard: list[Heard] = field(default_factory=list)
    dropped: list[Dropped] = field(default_factory=list)
    late: list[Late] = field(default_factory=list)
    released: list[Released] = field(default_factory=list)
    arrived: list[Arrived] = field(default_factory=list)
    events: list[dict[str, Any]] = field(default_factory=list)
    samples: list[Taken] = field(default_factory=list)
    commands: list[Commanded] = field(default_factory=list)
    payloads: list[Payload] = field(default_factory=list)
    measured: list[Measured] = field(default_factory=list)

    def __bool__(self) -> bool:
        """Whether there is anything in it."""
        return any(getattr(self, name) for name in ENTRIES) or bool(self.events)

    @property
    def last_ns(self) -> int:
        """The latest nominal time [ns] of any entry; 0 without any."""
        times = [sent.start_ns for sent in self.sent] + [heard.due_ns for heard in self.heard]
        for name in ("estimates", "dropped", "released", *FACT_ROWS):
            times += [entry.time_ns for entry in getattr(self, name)]
        return max(times, default=0)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for MessagePack and JSON."""
        return dict(self.__dict__)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Batch:
        """The batch that `to_dict` took apart."""
        entries = {name: [kind(*entry) for entry in data[name]] for name, kind in ENTRIES.items()}
        return cls(data["agent"], data["incarnation"], events=data["events"], **entries)
