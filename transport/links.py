"""A directed link as data: the settings that a fault may change, and the fates of frames.

queue → medium access → airtime → loss → corruption → duplication → latency → delivery. `transmitter` has the first
three stages, `propagation` the next four; the receiver's part, half-duplex and collision, is in `media`.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import isnan
from typing import Annotated, Literal

from ..errors import BadInput
from ..units import BitsPerSecond, Bounds, Bytes, Count, Period, Probability
from .latency_settings import LATENCIES, Constant
from .link_models import Latency, LatencyModel, LossModel
from .loss_settings import Losses, check_probability
from .media_settings import MEDIA, FullDuplex, Medium

NANOSECONDS = 1_000_000_000
SHORTEST_TRAVEL_NS = 1
"""Smallest time from start to due: an event never causes another agent's event at the same instant."""
DELIVERED, CUT, HALF_DUPLEX, COLLISION, LOST, CORRUPT = (
    "delivered",
    "cut",
    "half-duplex",
    "collision",
    "loss",
    "corrupt",
)
"""Fates of a frame on the air; if several causes apply, the first one in this order counts."""
SHORTEST_SLOT_NS = 100_000
ACCESS = "access"
"""Fate of a frame whose radio gave up its attempts to access the medium."""


@lru_cache(maxsize=1024)
def duration_ns(bits: int, rate: float) -> int:
    """Duration of this many bits at a rate in bit/s, rounded up."""
    exact = Fraction(rate) if rate % 1 else int(rate)
    return -(-bits * NANOSECONDS // exact)


@dataclass(frozen=True)
class Queue:
    """Queue of frames that wait for the transmitter.

    limit: largest number of waiting frames.
    policy: which frame is dropped from a full queue. drop-tail: the new one; drop-head: the oldest; latest: a new frame
        replaces a waiting one of the same stream, and is dropped only if there is none.
    """

    limit: Count = 64
    policy: Literal["drop-tail", "drop-head", "latest"] = "drop-tail"

    def __post_init__(self) -> None:
        """Check the bound."""
        if self.limit < 1:
            raise BadInput(f"queue limit is {self.limit}, at least 1 frame must fit")


@dataclass(frozen=True)
class Bucket:
    """Token bucket.

    rate: largest average rate.
    burst: largest amount that may be sent at once.
    """

    rate: BitsPerSecond
    burst: Annotated[Bytes, Bounds(above=0)]

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.rate > 0 or self.burst < 1:
            raise BadInput(f"a bucket of {self.rate:g} bit/s and {self.burst} B holds nothing: both are above 0")


@dataclass(frozen=True)
class LinkSettings:
    """Settings of one directed link, all of which a fault may change.

    medium: medium, and when its users may transmit.
    rate: bit rate of the transmitter; without one frames take no time on the air.
    overhead: bytes of a frame in addition to its payload.
    bits_per_byte: bits on the air per byte, 10 for a UART with start and stop bit.
    mtu: largest payload.
    queue: queue of frames that wait for the transmitter.
    bucket: token bucket that limits the average rate.
    loss: loss models, any of which may lose a frame.
    corruption: models of frames with bit errors, which the receiver's checksum detects.
    duplication: probability that a frame that is not lost arrives twice, the copy with damage and latency of its own.
    latency: one-way latency after the last bit was sent.
    reordering: whether a frame may overtake an earlier one.
    cut: whether the link is cut and no frame passes.
    hold: whether due frames are held back until this ends.
    present: whether the graph has this link at the moment.
    paired: length of the time slots to which the draws of loss, corruption, duplication and latency belong, as with
        block fading: all frames that start in one slot have the same draws, whatever was sent before. Without it each
        frame has separate draws, by its sequence number.
    """

    medium: Annotated[Medium, MEDIA] = FullDuplex()  # noqa: RUF009 - frozen
    rate: BitsPerSecond | None = None
    overhead: Bytes = 0
    bits_per_byte: Count = 8
    mtu: Annotated[Bytes, Bounds(above=0)] = 1500
    queue: Queue = Queue()
    bucket: Bucket | None = None
    loss: Losses = ()
    corruption: Losses = ()
    duplication: Probability = 0.0
    latency: Annotated[Latency, LATENCIES] = Constant(0)  # noqa: RUF009 - frozen
    reordering: bool = True
    cut: bool = False
    hold: bool = False
    present: bool = True
    paired: Period | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.rate is not None and not self.rate > 0:
            raise BadInput(f"rate is {self.rate:g} bit/s, it must be above 0")
        if self.overhead < 0 or self.bits_per_byte < 1 or self.mtu < 1:
            raise BadInput("overhead is at least 0 B, bits_per_byte at least 1, mtu at least 1 B")
        check_probability("duplication", self.duplication)
        if self.paired is not None and self.paired < SHORTEST_SLOT_NS:
            raise BadInput(f"paired is {self.paired} ns, a slot of a paired channel lasts at least 100 us")

        for model in (*self.loss, *self.corruption, self.latency):
            if isinstance(model, LossModel | LatencyModel):
                model.check()

    def draw_index(self, sequence: int, start_ns: int) -> int:
        """Index of a frame's draws: its sequence number, or with `paired` the time slot in which it starts."""
        return sequence if self.paired is None else start_ns // self.paired

    def bits(self, payload_bytes: int) -> int:
        """Length of a frame on the air: (payload + overhead) · bits per byte."""
        return (payload_bytes + self.overhead) * self.bits_per_byte

    def airtime_ns(self, payload_bytes: int) -> int:
        """Time on the air of a frame: its bits / rate, rounded up; 0 without a rate."""
        return 0 if self.rate is None else duration_ns(self.bits(payload_bytes), self.rate)

    def typical_latency_ns(self) -> int:
        """Mean latency, or the smallest one if the model does not know its mean."""
        mean_ns = self.latency.mean_ns
        return self.latency.minimum_ns if isnan(mean_ns) else int(mean_ns)

    def lookahead_ns(self) -> int:
        """Shortest time from start to due: airtime of an empty payload plus minimum latency."""
        return self.airtime_ns(0) + self.latency.minimum_ns


def fate(verdict: str, *, deaf: bool, collided: bool = False) -> str:
    """Fate of a transmitted frame; if several causes apply, the first one in the order above counts."""
    if verdict == CUT:
        return CUT
    return HALF_DUPLEX if deaf else COLLISION if collided else verdict
