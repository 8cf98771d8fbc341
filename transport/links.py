"""A directed link: its settings, and the sender's part of its pipeline.

queue → medium access → airtime → loss → latency. The receiver's part, half-duplex, is in `media`.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, NamedTuple

from ..errors import BadInput
from ..topologies import natural_key
from ..units import BitsPerSecond, Bytes
from .latencies import Constant, Latency
from .losses import Loss
from .media import EDGE_SLOTS, FullDuplex, HalfDuplex, Medium, Transceiver
from .stages import Surroundings

NANOSECONDS = 1_000_000_000
SHORTEST_TRAVEL_NS = 1
"""No frame is due at the instant at which it starts: what is handled at one instant causes nothing at that instant."""
DELIVERED, CUT, HALF_DUPLEX, COLLISION, LOST, CORRUPT = (
    "delivered",
    "cut",
    "half-duplex",
    "collision",
    "loss",
    "corrupt",
)
"""Fates of a frame on the air, in the order in which they count where causes overlap."""


@dataclass(frozen=True)
class Queue:
    """Frames that wait for the transmitter: how many may, and which one gives way when one too many comes.

    drop-tail refuses the newcomer, drop-head the oldest; latest lets a newer frame of the same stream take the place of
    the one that waits, and drops the newcomer only where nothing can be replaced.
    """

    limit: int = 64
    policy: Literal["drop-tail", "drop-head", "latest"] = "drop-tail"

    def __post_init__(self) -> None:
        """Check the bound."""
        if self.limit < 1:
            raise BadInput(f"queue limit is {self.limit}, at least 1 frame must fit")


@dataclass(frozen=True)
class Bucket:
    """Token bucket: on average no more than `rate` leaves, up to `burst` at once."""

    rate: BitsPerSecond
    burst: Bytes

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.rate > 0 or self.burst < 1:
            raise BadInput(f"a bucket of {self.rate:g} bit/s and {self.burst} B holds nothing: both are above 0")


@dataclass(frozen=True)
class LinkSettings:
    """Everything that a fault may change on one directed link.

    `corruption`: models that say which frames the checksum will refuse. `duplication`: probability that a frame comes
    twice, the copy with a latency of its own. `reordering`: whether a frame may overtake an earlier one. `hold`: frames
    that are due meanwhile wait, and come when they are released. `present`: whether the graph has this link now.
    """

    medium: Medium = FullDuplex()  # noqa: RUF009 - frozen
    rate: BitsPerSecond | None = None
    overhead: Bytes = 0
    bits_per_byte: int = 8
    mtu: Bytes = 1500
    queue: Queue = Queue()
    bucket: Bucket | None = None
    loss: tuple[Loss, ...] = ()
    corruption: tuple[Loss, ...] = ()
    duplication: float = 0.0
    latency: Latency = Constant(0)  # noqa: RUF009 - frozen
    reordering: bool = True
    cut: bool = False
    hold: bool = False
    present: bool = True

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.rate is not None and not self.rate > 0:
            raise BadInput(f"rate is {self.rate:g} bit/s, it must be above 0")
        if self.overhead < 0 or self.bits_per_byte < 1 or self.mtu < 1:
            raise BadInput("overhead is at least 0 B, bits_per_byte at least 1, mtu at least 1 B")
        if not 0 <= self.duplication <= 1:
            raise BadInput(f"duplication is {self.duplication:g}, a probability lies between 0 and 1")

    def airtime_ns(self, payload_bytes: int) -> int:
        """Time on the air of a frame: (payload + overhead) · bits per byte / rate, rounded up; 0 without a rate."""
        if self.rate is None:
            return 0
        bits = (payload_bytes + self.overhead) * self.bits_per_byte
        rate = Fraction(self.rate) if self.rate % 1 else int(self.rate)
        return -(-bits * NANOSECONDS // rate)

    def lookahead_ns(self) -> int:
        """The least that these settings ask for from start to due: airtime of an empty payload and shortest latency."""
        return self.airtime_ns(0) + self.latency.minimum_ns


class Waiting(NamedTuple):
    """A frame in the queue."""

    sequence: int
    payload: bytes
    stream: str


class Transmission(NamedTuple):
    """A frame that has started: its interval on the air, when it is due, and the sender's verdict on it."""

    sequence: int
    payload: bytes
    start_ns: int
    airtime_ns: int
    due_ns: int
    verdict: str


class Sender:
    """The sending end of the link src → dst: a state machine without a clock.

    `incarnation` counts the restarts of the source; a restarted agent draws from streams of its own.
    """

    __slots__ = (
        "_ahead",
        "_around",
        "_free_at",
        "_latency",
        "_losses",
        "_slot",
        "_waiting",
        "sequence",
        "settings",
        "transceiver",
    )

    def __init__(self, seed: int, source: str, target: str, incarnation: int, settings: LinkSettings) -> None:
        self._around = Surroundings.of(seed, source, target, incarnation)
        self._slot = int(natural_key(source) > natural_key(target))
        self._free_at = 0
        self._waiting: deque[Waiting] = deque()
        self._ahead: deque[int] = deque()
        self.sequence = 0
        self.transceiver = Transceiver()
        self.settings = settings
        self._losses = [model.stage(self._around) for model in settings.loss]
        self._latency = settings.latency.stage(self._around)

    def change(self, settings: LinkSettings) -> None:
        """Take new settings; models that stay keep their state."""
        before, self.settings = self.settings, settings
        if settings.loss != before.loss:
            self._losses = [model.stage(self._around) for model in settings.loss]
        if settings.latency != before.latency:
            self._latency = settings.latency.stage(self._around)

    def offer(self, now_ns: int, payload: bytes, stream_name: str = "") -> list[int]:
        """Put a frame into the queue; the sequence numbers that its policy throws out, in order.

        A frame that was transmitted ahead of its start takes up room until then. The caller has checked the size
        against the MTU.
        """
        while self._ahead and self._ahead[0] <= now_ns:
            self._ahead.popleft()
        newcomer = Waiting(self.sequence, payload, stream_name)
        self.sequence += 1
        queue = self.settings.queue
        if queue.policy == "latest":
            for place, waiting in enumerate(self._waiting):
                if waiting.stream == stream_name:
                    self._waiting[place] = newcomer
                    return [waiting.sequence]
        if len(self._waiting) + len(self._ahead) < queue.limit:
            self._waiting.append(newcomer)
            return []
        if queue.policy == "drop-head":
            self._waiting.append(newcomer)
            return [self._waiting.popleft().sequence]
        return [newcomer.sequence]

    def refuse(self) -> int:
        """Count a frame that is too large to be offered; its sequence number."""
        self.sequence += 1
        return self.sequence - 1

    def waiting(self) -> list[int]:
        """Sequence numbers of the frames in the queue."""
        return [frame.sequence for frame in self._waiting]

    def next_start(self, now_ns: int) -> int | None:
        """When the frame at the head of the queue may start, as things stand; None with an empty queue."""
        if not self._waiting:
            return None
        ready = max(now_ns, self._free_at)
        medium = self.settings.medium
        if isinstance(medium, FullDuplex):
            return ready
        airtime = self.settings.airtime_ns(len(self._waiting[0].payload))
        return medium.access.earliest_start(ready, airtime, self._slot, EDGE_SLOTS)

    @property
    def settled(self) -> bool:
        """Whether nothing that is offered later can take the place of a frame that waits."""
        return self.settings.queue.policy == "drop-tail"

    def earliest_next(self, ready_ns: int) -> int:
        """The earliest start of a frame that is not offered before `ready_ns`: the promise of lockstep pace."""
        ready = max(ready_ns, self._free_at)
        medium = self.settings.medium
        if isinstance(medium, FullDuplex):
            return ready
        return medium.access.earliest_start(ready, self.settings.airtime_ns(0), self._slot, EDGE_SLOTS)

    def transmit_ahead(self, start_ns: int) -> Transmission:
        """Start the frame at the head of the queue at an instant to come, at which nothing will have changed."""
        self._ahead.append(start_ns)
        return self.transmit(start_ns)

    def transmit(self, now_ns: int) -> Transmission:
        """Start the frame at the head of the queue now; every link parameter is read here, once."""
        sequence, payload, _ = self._waiting.popleft()
        settings = self.settings
        airtime = settings.airtime_ns(len(payload))
        end = self._free_at = now_ns + airtime
        if isinstance(settings.medium, HalfDuplex):
            self.transceiver.transmit(now_ns, end)
        lost = False
        bits = (len(payload) + settings.overhead) * settings.bits_per_byte
        for stage in self._losses:
            lost |= stage.lost(sequence, now_ns, bits)
        due = max(end + self._latency(sequence, end), now_ns + SHORTEST_TRAVEL_NS)
        verdict = CUT if settings.cut else LOST if lost else DELIVERED
        return Transmission(sequence, payload, now_ns, airtime, due, verdict)


def fate(verdict: str, *, deaf: bool) -> str:
    """What became of a transmitted frame; of causes that overlap the first of cut, half-duplex, loss counts."""
    return HALF_DUPLEX if deaf and verdict != CUT else verdict
