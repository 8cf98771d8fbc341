"""The sending end of a link, or of all links of a node's radio: queue → token bucket → medium access → airtime."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from typing import NamedTuple

from .clock import Clock
from .csma import Csma
from .links import LinkSettings, duration_ns
from .media import EDGE_SLOTS, FullDuplex, HalfDuplex, Transceiver
from .propagation import Copy, Propagation

Numbered = tuple[tuple[str, int], ...]
"""(target, sequence number on the link to it), for each that a frame is for."""


class Waiting(NamedTuple):
    """A frame in the queue."""

    targets: Numbered
    payload: bytes
    stream: str


class Transmission(NamedTuple):
    """A frame that has started: its interval on the air, and its arrivals."""

    payload: bytes
    start_ns: int
    airtime_ns: int
    copies: list[Copy]


class Transmitter:
    """A state machine without a clock.

    Args:
        ways: where its frames go. They agree in all settings that are read here: medium, rate, overhead, bits per byte,
            queue and bucket.
        slot: which of the slots of its medium is its own.
        slots: how many there are.

    `settings`: those of its links, in what they agree.
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
        """The link to one target has new settings from now on."""
        self._by_target[target].change(settings)
        self.settings = self.ways[0].settings
        self._head_start = self._next_start = None

    def set_clock(self, clock: Clock) -> None:
        """Slots follow another reading from now on."""
        self._clock = clock
        self._head_start = self._next_start = None

    def offer(self, now_ns: int, targets: Collection[str], payload: bytes, stream: str = "") -> Numbered:
        """Put a frame into the queue; what its policy throws out, in order.

        A frame that was transmitted ahead of its start takes up room until then: it leaves after the first frame that
        is offered at that instant has come. The caller has checked the size against the MTU.
        """
        self._make_room(now_ns)
        thrown_out = self._put(Waiting(self.count(targets), payload, stream))
        self._make_room(now_ns + 1)
        return thrown_out

    def _make_room(self, before_ns: int) -> None:
        """Forget what was transmitted ahead and has started before an instant."""
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
        """Count a frame, offered or too large to be; its sequence numbers."""
        return tuple((target, self._by_target[target].count()) for target in targets)

    def waiting(self) -> list[tuple[str, int]]:
        """Targets and sequence numbers of the frames in the queue."""
        return [numbered for frame in self._waiting for numbered in frame.targets]

    def next_start(self, now_ns: int) -> int | None:
        """When the frame at the head of the queue may start, as things stand; None with an empty queue.

        A start that was found before and is not over yet is the first still.
        """
        if not self._waiting:
            return None
        if self._head_start is None or self._head_start < now_ns:
            self._head_start = self._start(now_ns, len(self._waiting[0].payload))
        return self._head_start

    def earliest_next(self, ready_ns: int) -> int:
        """The earliest start of a frame that is not offered before `ready_ns`: the promise of lockstep pace.

        It is asked for the same instant again and again, while frames come in.
        """
        if self._next_start is None or self._next_start[0] != ready_ns:
            self._next_start = ready_ns, self._start(ready_ns, 0)
        return self._next_start[1]

    def _ready(self, ready_ns: int, payload_bytes: int) -> int:
        """When the last frame has left, and the token bucket lets one of this size pass."""
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
            return medium.access.earliest_start(ready, airtime, self._slot, self._slots)
        first_reading = self._clock.first_reading(ready)
        start = medium.access.earliest_start(first_reading, airtime, self._slot, self._slots)
        return self._clock.when(start, ready)

    @staticmethod
    def _burst_ns(settings: LinkSettings) -> int:
        assert settings.bucket is not None
        return duration_ns(settings.bucket.burst * settings.bits_per_byte, settings.bucket.rate)

    @property
    def settled(self) -> bool:
        """Whether nothing that is offered later can take the place of a frame that waits."""
        return self.settings.queue.policy == "drop-tail"

    def give_up(self) -> Numbered:
        """Throw out the frame at the head of the queue; what it was."""
        self._head_start = None
        return self._waiting.popleft().targets

    def head_ready(self, now_ns: int) -> int:
        """When the frame at the head of the queue may contend for its medium, from an instant on."""
        return self._ready(now_ns, len(self._waiting[0].payload))

    def transmit_ahead(self, start_ns: int) -> Transmission:
        """Start the frame at the head of the queue at an instant to come, at which nothing will have changed."""
        self._ahead.append(start_ns)
        return self.transmit(start_ns)

    def transmit(self, now_ns: int) -> Transmission:
        """Start the frame at the head of the queue now; every link parameter is read here, once.

        The token bucket is the virtual scheduling form of ITU-T I.371: a full bucket holds `burst`, and the theoretical
        time of the next frame moves on by a frame's length at the bucket's rate.
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
