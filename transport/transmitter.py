"""The sending end of a link, or of all links of a node's radio: queue → token bucket → medium access → airtime."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from typing import NamedTuple

from .clock import Clock
from .links import LinkSettings, duration_ns
from .media import Transceiver, earliest_start
from .media_settings import EDGE_SLOTS, Csma, FullDuplex, HalfDuplex
from .propagation import Copy, Propagation

Numbered = tuple[tuple[str, int], ...]
"""(target, sequence number on the link to it) for each target of a frame."""


class Waiting(NamedTuple):
    """A frame in the queue."""

    targets: Numbered
    payload: bytes
    stream: str


class Transmission(NamedTuple):
    """A transmitted frame: its interval on the air, and its arrivals."""

    payload: bytes
    start_ns: int
    airtime_ns: int
    copies: list[Copy]


class Transmitter:
    """The transmitter of a link or radio: a state machine without a clock.

    Args:
        ways: propagation to each target. All have the same medium, rate, overhead, bits per byte, queue and bucket.
        slot: number of its slot of the medium.
        slots: number of slots of the medium.

    `settings`: the settings that are common to its links.
    """

    __slots__ = (
        "_ahead",
        "_by_target",
        "_clock",
        "_free_at",
        "_head_start",
        "_next_start",
        "_slot",
        "_slots",
        "_theoretical",
        "_waiting",
        "settings",
        "transceiver",
        "ways",
    )

    def __init__(self, ways: Sequence[Propagation], slot: int = 0, slots: int = EDGE_SLOTS) -> None:
        self.ways = tuple(ways)
        self.settings = self.ways[0].settings
        self._clock = Clock()
        self.transceiver = Transceiver()
        self._by_target = {way.target: way for way in ways}
        self._slot, self._slots = slot, slots
        self._free_at = 0
        self._theoretical = 0
        self._head_start: int | None = None
        self._next_start: tuple[int, int] | None = None
        self._waiting: deque[Waiting] = deque()
        self._ahead: deque[int] = deque()

    def change(self, target: str, settings: LinkSettings) -> None:
        """Change the settings of the link to one target."""
        self._by_target[target].change(settings)
        self.settings = self.ways[0].settings
        self._head_start = self._next_start = None

    def set_clock(self, clock: Clock) -> None:
        """Change the local clock that slots follow."""
        self._clock = clock
        self._head_start = self._next_start = None

    def offer(self, now_ns: int, targets: Collection[str], payload: bytes, stream: str = "") -> Numbered:
        """Put a frame into the queue, and return the frames that its policy drops, in order.

        A frame that was transmitted early stays in the queue until its start, and leaves after the first frame that is
        offered at that instant. The caller must have checked the size against the MTU.
        """
        self._make_room(now_ns)
        thrown_out = self._put(Waiting(self.count(targets), payload, stream))
        self._make_room(now_ns + 1)
        return thrown_out

    def _make_room(self, before_ns: int) -> None:
        """Forget frames that were transmitted early and have started before an instant."""
        while self._ahead and self._ahead[0] < before_ns:
            self._ahead.popleft()

    def _put(self, newcomer: Waiting) -> Numbered:
        queue = self.settings.queue
        if queue.policy == "latest":
            for place, waiting in enumerate(self._waiting):
                if waiting.stream == newcomer.stream and dict(waiting.targets).keys() == dict(newcomer.targets).keys():
                    self._waiting[place] = newcomer
                    self._head_start = None
                    return waiting.targets
        if len(self._waiting) + len(self._ahead) < queue.limit:
            self._waiting.append(newcomer)
            return ()
        if queue.policy == "drop-head":
            self._waiting.append(newcomer)
            self._head_start = None
            return self._waiting.popleft().targets
        return newcomer.targets

    def count(self, targets: Collection[str]) -> Numbered:
        """Count a frame, offered or too large, and return its sequence numbers."""
        return tuple((target, self._by_target[target].count()) for target in targets)

    def waiting(self) -> list[tuple[str, int]]:
        """Targets and sequence numbers of the frames in the queue."""
        return [numbered for frame in self._waiting for numbered in frame.targets]

    def next_start(self, now_ns: int) -> int | None:
        """Earliest start of the frame at the head of the queue, with the present settings; None if the queue is empty.

        A start that was found before remains valid until it has passed.
        """
        if not self._waiting:
            return None
        if self._head_start is None or self._head_start < now_ns:
            self._head_start = self._start(now_ns, len(self._waiting[0].payload))
        return self._head_start

    def earliest_next(self, ready_ns: int) -> int:
        """Earliest start of a frame that is not offered before `ready_ns`: the promise of lockstep pace.

        Cached, as it is called repeatedly for the same instant.
        """
        if self._next_start is None or self._next_start[0] != ready_ns:
            self._next_start = ready_ns, self._start(ready_ns, 0)
        return self._next_start[1]

    def _ready(self, ready_ns: int, payload_bytes: int) -> int:
        """When the last frame has been sent, and the token bucket allows one of this size."""
        settings = self.settings
        ready = max(ready_ns, self._free_at)
        if settings.bucket is not None:
            bits = settings.bits(payload_bytes)
            ready = max(ready, self._theoretical + duration_ns(bits, settings.bucket.rate) - self._burst_ns(settings))
        return ready

    def _start(self, ready_ns: int, payload_bytes: int) -> int:
        ready, settings = self._ready(ready_ns, payload_bytes), self.settings
        medium = settings.medium
        if isinstance(medium, FullDuplex):
            return ready
        airtime = settings.airtime_ns(payload_bytes)
        if self._clock.true or isinstance(medium.access, Csma):
            return earliest_start(medium.access, ready, airtime, self._slot, self._slots)
        first_reading = self._clock.first_reading(ready)
        start = earliest_start(medium.access, first_reading, airtime, self._slot, self._slots)
        return self._clock.when(start, ready)

    @staticmethod
    def _burst_ns(settings: LinkSettings) -> int:
        assert settings.bucket is not None
        return duration_ns(settings.bucket.burst * settings.bits_per_byte, settings.bucket.rate)

    @property
    def settled(self) -> bool:
        """Whether no frame offered later can replace a waiting one."""
        return self.settings.queue.policy == "drop-tail"

    def give_up(self) -> Numbered:
        """Drop the frame at the head of the queue, and return its targets and numbers."""
        self._head_start = None
        return self._waiting.popleft().targets

    def head_ready(self, now_ns: int) -> int:
        """First instant from `now_ns` on at which the frame at the head of the queue may contend for its medium."""
        return self._ready(now_ns, len(self._waiting[0].payload))

    def transmit_ahead(self, start_ns: int) -> Transmission:
        """Transmit the frame at the head of the queue early, for a later start until which nothing changes."""
        self._ahead.append(start_ns)
        return self.transmit(start_ns)

    def transmit(self, now_ns: int) -> Transmission:
        """Transmit the frame at the head of the queue now, with the present settings.

        The token bucket uses the virtual scheduling algorithm of ITU-T I.371: a full bucket holds `burst`, and each
        frame increases the theoretical arrival time of the next by its length at the bucket's rate.
        """
        targets, payload, _ = self._waiting.popleft()
        self._head_start = self._next_start = None
        settings = self.settings
        bits, airtime = settings.bits(len(payload)), settings.airtime_ns(len(payload))
        end = self._free_at = now_ns + airtime
        if settings.bucket is not None:
            self._theoretical = max(now_ns, self._theoretical) + duration_ns(bits, settings.bucket.rate)
        if isinstance(settings.medium, HalfDuplex):
            self.transceiver.transmit(now_ns, end)
        name, number = targets[0]
        copies = self._by_target[name].send(number, now_ns, end, bits)
        for name, number in targets[1:]:
            copies += self._by_target[name].send(number, now_ns, end, bits)
        return Transmission(payload, now_ns, airtime, copies)
