"""Encoding of a formation's messages `pair` and `full`, their sizes, and stamps that wrap.

All numbers are little-endian, those of the estimate in the precision of the layout.

`pair`: a header of 10 bytes, that is kind (1), sender (1), seen vehicle (1), stamp in µs modulo 2⁴⁰ (5), and how long
the vehicle has not been seen in ms, at most 65535 (2); then position and velocity, 6 numbers; the attitude, 4 numbers,
where the layout has it; the covariance, where it has one. In float32 with attitude that is 50 bytes.

`full`: a stamp in ms modulo 2¹⁶ (2); then the state, 6(N−1) numbers; then the covariance, where the layout has one. The
sender is known from the link. In float32 for three vehicles that is 50 bytes.

A covariance is a `bound`, two deviations for each relative position and velocity (`bound_of`), or `whole`, k deviations
and k(k−1)/2 correlations, a lower triangle row by row. Both are enlarged by the largest rounding error, so that the
decoded covariance is never smaller than the encoded one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...estimators.formation.covariance import check_positive
from ...estimators.formation.formation_messages import FullMessage, Message, PairMessage, bound_of
from ..payloads import DTYPES, DamagedPayload, Precision

Kind = Literal["pair", "full"]
CovarianceContent = Literal["none", "bound", "whole"]

_PAIR = 1
_HEADER = {"pair": 10, "full": 2}
_STAMP_BITS: dict[Kind, int] = {"pair": 40, "full": 16}
_STAMP_UNIT_NS: dict[Kind, int] = {"pair": 1_000, "full": 1_000_000}
_LARGEST_UNSEEN_MS = 2**16 - 1


@dataclass(frozen=True)
class Layout:
    """Layout of a formation's messages; sender and receivers use the same.

    kind: `pair` or `full`.
    vehicles: N, at most 256.
    precision: of the numbers.
    attitude: whether a `pair` carries the sender's attitude.
    covariance: `none`, `bound` or `whole`.
    """

    kind: Kind
    vehicles: int
    precision: Precision = "float32"
    attitude: bool = True
    covariance: CovarianceContent = "none"

    def __post_init__(self) -> None:
        """Check that vehicle numbers fit in a byte."""
        if not 2 <= self.vehicles <= 256:
            raise BadInput(f"messages of {self.vehicles} vehicles: their numbers are one byte, give 2 to 256")

    @cached_property
    def values(self) -> int:
        """Number of numbers in the estimate."""
        return 6 if self.kind == "pair" else 6 * (self.vehicles - 1)

    @cached_property
    def numbers(self) -> int:
        """Number of numbers in a message."""
        attitude = 4 if self.attitude and self.kind == "pair" else 0
        covariance = {"none": 0, "bound": self.values // 3, "whole": self.values * (self.values + 1) // 2}
        return self.values + attitude + covariance[self.covariance]

    @cached_property
    def size(self) -> int:
        """Size of a message [bytes]."""
        return _HEADER[self.kind] + self.numbers * DTYPES[self.precision].itemsize

    def check_fits(self, packet_bytes: int) -> None:
        """Refuse a packet that is too small.

        Raises:
            BadInput: with both sizes, and what fits.
        """
        if self.size <= packet_bytes:
            return
        others = [
            Layout(kind, self.vehicles, precision, attitude, self.covariance)
            for kind in (self.kind, "pair")
            for attitude in ((True, False) if kind == "pair" else (False,))
            for precision in DTYPES
        ]
        fits = next((f"{each.describe()} has {each.size} B" for each in others if each.size <= packet_bytes), None)
        remedy = f", and {fits}" if fits else ""
        raise BadInput(
            f"a packet of {packet_bytes} B is too small for {self.describe()}, {self.size} B: "
            f"give larger packets{remedy}"
        )

    def describe(self) -> str:
        """The layout in words."""
        extras = ["attitude"] if self.attitude and self.kind == "pair" else []
        if self.covariance != "none":
            extras.append("a bound of the covariance" if self.covariance == "bound" else "the covariance")
        plain = f"`{self.kind}` of {self.vehicles} vehicles in {self.precision}"
        return f"{plain} with {' and '.join(extras)}" if extras else plain


def encode(layout: Layout, message: Message) -> bytes:
    """Encode a message.

    Raises:
        BadInput: the message is of another kind, or lacks what the layout has.
    """
    kind: Kind = "pair" if isinstance(message, PairMessage) else "full"
    if layout.kind != kind or len(message.values) != layout.values:
        raise BadInput(
            f"a `{kind}` of {len(message.values)} numbers in a layout of `{layout.kind}` with {layout.values}"
        )
    header, parts = _stamp("full", message.time_ns), [message.values]
    if isinstance(message, PairMessage):
        header = _pair_header(message)
        if layout.attitude:
            parts.append(_given(message.attitude, "attitude"))
    if layout.covariance != "none":
        parts.append(
            _covariance_numbers(layout, message.values, _given(message.covariance, f"{layout.covariance} covariance"))
        )
    numbers: bytes = np.concatenate(parts).astype(DTYPES[layout.precision]).tobytes()
    return header + numbers


def decode(layout: Layout, payload: bytes, *, sender: int, now_ns: int) -> Message:
    """Decode a message, its numbers as new float64 arrays.

    Args:
        layout: the sender's.
        payload: the bytes.
        sender: number of the sender, known from the link.
        now_ns: the receiver's clock [ns]; a stamp is the instant nearest to it that fits.
    Raises:
        DamagedPayload: another length or kind, another sender, a vehicle that does not exist, or numbers that are not
        finite.
    """
    if len(payload) != layout.size:
        raise DamagedPayload(f"{len(payload)} bytes where {layout.describe()} has {layout.size}")
    head = _HEADER[layout.kind]
    numbers = np.frombuffer(payload[head:], dtype=DTYPES[layout.precision]).astype(np.float64)
    if not math.isfinite(numbers.dot(numbers)):
        raise DamagedPayload(f"a message of {sender} holds numbers that are not finite, or too large to be squared")
    values, rest = numbers[: layout.values].copy(), numbers[layout.values :]
    if layout.kind == "full":
        return FullMessage(sender, _instant("full", payload[:2], now_ns), values, _covariance(layout, rest, sender))
    attitude, rest = (rest[:4].copy(), rest[4:]) if layout.attitude else (None, rest)
    kind, claimed_sender, seen = payload[:3]
    if kind != _PAIR or claimed_sender != sender or seen >= layout.vehicles or seen == sender:
        raise DamagedPayload(f"a header of kind {kind}, vehicles {claimed_sender} and {seen}, from {sender}")
    unseen_ns = int.from_bytes(payload[8:10], "little") * 1_000_000
    time_ns = _instant("pair", payload[3:8], now_ns)
    return PairMessage(sender, seen, time_ns, values, unseen_ns, attitude, _covariance(layout, rest, sender))


def _pair_header(message: PairMessage) -> bytes:
    unseen_ms = min(-(-message.unseen_ns // 1_000_000), _LARGEST_UNSEEN_MS)
    return (
        bytes((_PAIR, message.sender, message.seen)) + _stamp("pair", message.time_ns) + unseen_ms.to_bytes(2, "little")
    )


def _stamp(kind: Kind, time_ns: int) -> bytes:
    bits = _STAMP_BITS[kind]
    count: int = time_ns // _STAMP_UNIT_NS[kind] % (1 << bits)
    return count.to_bytes(bits // 8, "little")


def _instant(kind: Kind, stamp: bytes, now_ns: int) -> int:
    """Instant with this stamp that is nearest to now."""
    unit_ns, modulus = _STAMP_UNIT_NS[kind], 1 << _STAMP_BITS[kind]
    now = now_ns // unit_ns
    ahead = (int.from_bytes(stamp, "little") - now + modulus // 2) % modulus - modulus // 2
    return (now + ahead) * unit_ns


def _given(array: NDArray[np.float64] | None, what: str) -> NDArray[np.float64]:
    if array is None:
        raise BadInput(f"the layout has the {what}, and the message has none: give it, or choose a layout without")
    return array


def _covariance_numbers(
    layout: Layout, values: NDArray[np.float64], covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Numbers of a covariance, enlarged by the rounding errors of these numbers and of the values."""
    kind = DTYPES[layout.precision]
    unit, count = float(np.finfo(kind).eps), len(values)
    if layout.covariance == "whole":
        # Each correlation is rounded by up to half a unit, the k of a row by k/2: the diagonal is enlarged by that.
        variances = covariance.diagonal() * (1.0 + count * unit) + count * (unit / 2 * values) ** 2
        deviations = (np.sqrt(variances) * (1.0 + unit)).astype(kind).astype(np.float64)
        lower = covariance / np.outer(deviations, deviations)
        np.fill_diagonal(lower, deviations)
        return lower[np.tril_indices(count)]
    # One bound for each relative position and velocity; of m parts together, P ≤ m · blockdiag(P_1, …, P_m).
    parts = [slice(at, at + 6) for at in range(0, count, 6)]
    bounds = np.array([bound_of(covariance[part, part]) for part in parts])
    bounds += unit * np.linalg.norm(values.reshape(-1, 2, 3), axis=2)
    return np.ravel(bounds * np.sqrt(len(parts)) * (1.0 + unit))


def _covariance(layout: Layout, numbers: NDArray[np.float64], sender: int) -> NDArray[np.float64] | None:
    if layout.covariance == "none":
        return None
    if layout.covariance == "bound":
        matrix = np.diag(np.repeat(numbers**2, 3))
    else:
        lower = np.zeros((layout.values, layout.values))
        lower[np.tril_indices(layout.values)] = numbers
        deviations = lower.diagonal().copy()
        np.fill_diagonal(lower, 0.5)
        matrix = (lower + lower.T) * np.outer(deviations, deviations)
    try:
        check_positive(matrix, f"covariance of a message of {sender}")
    except BadInput as error:
        raise DamagedPayload(str(error)) from error
    return matrix
