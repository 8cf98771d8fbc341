"""What became of the frames of each link, summed up, and the airtime of each medium.

offered + duplicated = refused + queued-out + lost (by cause) + delivered + unknown (an end died unasked)
                     + in flight at the end

The sum closes exactly, or the record is not whole.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...topologies import natural_key
from ...transport.faults import LinkName
from ...transport.links import DELIVERED
from ...transport.media_settings import HalfDuplex, Medium, on_air
from ..record.frame_fates import (
    IN_FLIGHT,
    MISSING,
    QUEUE,
    REFUSED,
    UNKNOWN,
    FrameFate,
    frame_fates,
    is_lost,
    is_transmitted,
)
from ..record.record import Record

_QUANTILES = (0.5, 0.99, 1.0)


@dataclass(frozen=True)
class LinkAccount:
    """The frames of one directed link, by fate.

    `lost`: by cause, losses before the air included. `missing`: no fate at all, which is the middleware's loss and 0 in
    a healthy run. `contradicted`: two entries of a frame cannot both be true. `sent_bytes` of payload were on the air,
    `delivered_bytes` of them delivered. `utilisation` is airtime over the length of the run. `latency_ns`: quantiles
    0.5, 0.99 and 1 of the latencies that delivered frames really had, NaN without any. `late` frames came after
    something later was handled.
    """

    offered: int
    duplicated: int
    refused: int
    queue: int
    lost: Mapping[str, int]
    delivered: int
    unknown: int
    in_flight: int
    missing: int
    contradicted: int
    sent_bytes: int
    delivered_bytes: int
    airtime_ns: int
    utilisation: float
    latency_ns: tuple[float, float, float]
    late: int

    @property
    def transmitted(self) -> int:
        """Frames that were put on the air and whose fate is known: delivered, or lost on their way."""
        return self.delivered + sum(count for cause, count in self.lost.items() if is_transmitted(cause))

    @property
    def delivered_fraction(self) -> float:
        """Delivered frames of those transmitted; NaN without any."""
        return self.delivered / self.transmitted if self.transmitted else float("nan")

    @property
    def closes(self) -> bool:
        """Whether every offered frame has exactly one fate and nothing is missing or contradicted."""
        known = self.refused + self.queue + sum(self.lost.values()) + self.delivered + self.unknown + self.in_flight
        return self.offered + self.duplicated == known and not self.missing and not self.contradicted


def account(record: Record) -> dict[LinkName, LinkAccount]:
    """The account of each directed link, in natural order; links that never carried a frame included."""
    return {link: link_account(frames, record.last_ns) for link, frames in frame_fates(record).items()}


def link_account(frames: Sequence[FrameFate], elapsed_ns: int) -> LinkAccount:
    """The account of one link over a run of this length."""
    fates = Counter(frame.fate for frame in frames)
    sent = [frame for frame in frames if frame.start_ns is not None and not frame.copy]
    delivered = [frame for frame in frames if frame.fate == DELIVERED]
    airtime = sum(frame.airtime_ns or 0 for frame in sent)
    return LinkAccount(
        offered=sum(not frame.copy for frame in frames),
        duplicated=sum(frame.copy for frame in frames),
        refused=fates[REFUSED],
        queue=fates[QUEUE],
        lost={fate: count for fate, count in sorted(fates.items()) if is_lost(fate)},
        delivered=fates[DELIVERED],
        unknown=fates[UNKNOWN],
        in_flight=fates[IN_FLIGHT],
        missing=fates[MISSING],
        contradicted=sum(frame.contradicted for frame in frames),
        sent_bytes=sum(frame.size or 0 for frame in sent),
        delivered_bytes=sum(frame.size or 0 for frame in delivered),
        airtime_ns=airtime,
        utilisation=airtime / elapsed_ns if elapsed_ns else float("nan"),
        latency_ns=_quantiles(delivered),
        late=sum(frame.behind_ns is not None for frame in frames),
    )


def _quantiles(delivered: Sequence[FrameFate]) -> tuple[float, float, float]:
    latencies = [frame.latency_ns for frame in delivered if frame.latency_ns is not None]
    if not latencies:
        return (float("nan"),) * 3
    middle, high, most = np.quantile(latencies, _QUANTILES).tolist()
    return middle, high, most


def total(accounts: Iterable[LinkAccount]) -> dict[str, int]:
    """Counts over all links by fate, the losses by cause, in the order of the sum."""
    links = list(accounts)
    names = (
        "offered",
        "duplicated",
        "refused",
        "queue",
        "delivered",
        "unknown",
        "in_flight",
        "missing",
        "contradicted",
        "late",
    )
    sums = {name: sum(getattr(one, name) for one in links) for name in names}
    lost: Counter[str] = Counter()
    for one in links:
        lost.update(one.lost)
    return {**sums, **{f"lost ({cause})": count for cause, count in sorted(lost.items())}}


def medium_name(link: LinkName, medium: Medium) -> str:
    """What a link goes over: "3>7" a direction of its own, "3-7" the edge in turns, "radio 3" that of its source."""
    if on_air(medium):
        return f"radio {link[0]}"
    if isinstance(medium, HalfDuplex):
        return "-".join(sorted(link, key=natural_key))
    return ">".join(link)


def airtime_utilisation(record: Record) -> dict[str, float]:
    """Medium → airtime of all that went over it, over the length of the run; what all neighbours hear counts once."""
    used: dict[str, set[tuple[str, int, int, int]]] = {}
    for link, frames in frame_fates(record).items():
        transmissions = used.setdefault(medium_name(link, record.plan.links[link].medium), set())
        transmissions.update(
            (link[0], frame.incarnation, frame.start_ns, frame.airtime_ns)
            for frame in frames
            if frame.start_ns is not None and frame.airtime_ns is not None
        )
    elapsed = record.last_ns or 1
    return {name: sum(airtime for *_, airtime in once) / elapsed for name, once in used.items()}
