"""A directed link as data: everything that a fault may change on it, and what can become of a frame.

queue → medium access → airtime → loss → corruption → duplication → latency → delivery. `transmitter` has the first
three stages, `propagation` the next four; the receiver's part, half-duplex and collision, is in `media`.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Annotated, Literal

from ..errors import BadInput
from ..units import BitsPerSecond, Bytes, Count, Nanoseconds, Probability
from .latencies import LATENCIES, Constant, Latency
from .losses import Losses
from .media import MEDIA, FullDuplex, Medium
from .probabilities import check_probability

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
SHORTEST_SLOT_NS = 100_000
ACCESS = "access"
"""Fate of a frame whose radio gave up after attempts to get hold of the medium."""


@lru_cache(maxsize=1024)
def duration_ns(bits: int, rate: float) -> int:
    """How long so many bits take at a rate in bit/s, rounded up."""
    exact = Fraction(rate) if rate % 1 else int(rate)
    return -(-bits * NANOSECONDS // exact)


@dataclass(frozen=True)
class Queue:
    """Frames that wait for the transmitter: how many may, and which one gives way when one too many comes.

    limit: how many may wait.
    policy: drop-tail refuses the newcomer, drop-head the oldest; latest lets a newer frame of the same stream take the
        place of the one that waits, and drops the newcomer only where nothing can be replaced.
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

    rate: no more than this leaves on average.
    burst: what may leave at once.
    """

    rate: BitsPerSecond
    burst: Bytes

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.rate > 0 or self.burst < 1:
            raise BadInput(f"a bucket of {self.rate:g} bit/s and {self.burst} B holds nothing: both are above 0")


@dataclass(frozen=True)
class LinkSettings:
    """Everything that a fault may change on one directed link.

    medium: who may talk when.
    rate: of the transmitter; without one frames take no time on the air.
    overhead: what every frame has beside its payload.
    bits_per_byte: on the air, 10 for a UART with start and stop bit.
    mtu: the largest payload.
    queue: frames that wait for the transmitter.
    bucket: a limit of what may leave on average.
    loss: models of which any may lose a frame.
    corruption: models that say which frames the checksum will refuse.
    duplication: probability that a frame comes twice, the copy with a latency of its own.
    latency: one way, after the last bit has left.
    reordering: whether a frame may overtake an earlier one.
    cut: whether nothing passes.
    hold: frames that are due meanwhile wait, and come when they are released.
    present: whether the graph has this link now.
    paired: length of the slots of time to which the draws of loss, corruption, duplication and latency belong, as with
        block fading: all frames that start in one slot meet the same, whoever sends how many. Without it each frame has
        draws of its own, by its sequence number.
    """

    medium: Annotated[Medium, MEDIA] = FullDuplex()  # noqa: RUF009 - frozen
    rate: BitsPerSecond | None = None
    overhead: Bytes = 0
    bits_per_byte: Count = 8
    mtu: Bytes = 1500
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
    paired: Nanoseconds | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.rate is not None and not self.rate > 0:
            raise BadInput(f"rate is {self.rate:g} bit/s, it must be above 0")
        if self.overhead < 0 or self.bits_per_byte < 1 or self.mtu < 1:
            raise BadInput("overhead is at least 0 B, bits_per_byte at least 1, mtu at least 1 B")
        check_probability("duplication", self.duplication)
        if self.paired is not None and self.paired < SHORTEST_SLOT_NS:
            raise BadInput(f"paired is {self.paired} ns, a slot of a paired channel lasts at least 100 us")

    def draw_index(self, sequence: int, start_ns: int) -> int:
        """Index of the draws of a frame: its sequence number, with `paired` the slot of time that it starts in."""
        return sequence if self.paired is None else start_ns // self.paired

    def bits(self, payload_bytes: int) -> int:
        """Length of a frame on the air: (payload + overhead) · bits per byte."""
        return (payload_bytes + self.overhead) * self.bits_per_byte

    def airtime_ns(self, payload_bytes: int) -> int:
        """Time on the air of a frame: its bits / rate, rounded up; 0 without a rate."""
        return 0 if self.rate is None else duration_ns(self.bits(payload_bytes), self.rate)

    def lookahead_ns(self) -> int:
        """The least that these settings ask for from start to due: airtime of an empty payload and shortest latency."""
        return self.airtime_ns(0) + self.latency.minimum_ns


def fate(verdict: str, *, deaf: bool, collided: bool = False) -> str:
    """What became of a transmitted frame; of causes that overlap the first counts, in their order above."""
    if verdict == CUT:
        return CUT
    return HALF_DUPLEX if deaf else COLLISION if collided else verdict
