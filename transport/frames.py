"""The wire format of a frame: version, checksum, MessagePack. No pickle, nothing that can run code.

A frame carries its start, its time on the air, its due time, and the verdict of the sender's link. Lost frames are also
put, without their payload: gaps of sequence numbers then show losses by the middleware only, and the receiver can
decide half-duplex. A radio's transmission is put once for all receivers, with the verdict for each target.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import NamedTuple

import msgpack

from ..errors import VoleryError
from .links import DELIVERED
from .propagation import Copy

VERSION = 4
_HEAD = struct.Struct("<BI")


class DamagedFrame(VoleryError):
    """Bytes that are not a frame of this version, or have a wrong checksum."""


class Frame(NamedTuple):
    """One frame on a link, or a promise without a frame (`sequence` is then −1 and nothing is delivered).

    `promise_ns`: no later frame of this link starts before this instant; None without a promise. The start of a promise
    without a frame is the instant before which its sender has handled everything.
    `sent`: number of frames of this link and incarnation put so far, including this one. `copy` is 1 for a duplicate.
    `interventions`: how many live faults its sender knew of.
    """

    incarnation: int
    sequence: int
    start_ns: int
    airtime_ns: int
    due_ns: int
    verdict: str
    payload: bytes
    sent: int
    promise_ns: int | None
    copy: int = 0
    interventions: int = 0


class AirFrame(NamedTuple):
    """A radio's transmission to all its neighbours, or a promise without one (`sequence` is then −1).

    `sequence` counts the radio's transmissions. `copies`: target → its arrivals. `shaded`: the neighbours that do not
    hear it, because their link is cut or not present. `sent`, `promise_ns` and `interventions` as in `Frame`.
    """

    incarnation: int
    sequence: int
    start_ns: int
    airtime_ns: int
    payload: bytes
    sent: int
    promise_ns: int | None
    copies: Mapping[str, tuple[Copy, ...]]
    shaded: tuple[str, ...]
    interventions: int = 0

    @property
    def due_ns(self) -> int:
        """Due time of the first arrival; the start if there is none."""
        return min(
            (due_ns for arrivals in self.copies.values() for _, _, _, due_ns, _ in arrivals), default=self.start_ns
        )

    def for_target(self, target: str) -> list[Frame]:
        """The frames for one neighbour."""
        return [
            Frame(
                self.incarnation,
                sequence,
                self.start_ns,
                self.airtime_ns,
                due_ns,
                verdict,
                self.payload if verdict == DELIVERED else b"",
                self.sent,
                self.promise_ns,
                copy,
            )
            for _, sequence, copy, due_ns, verdict in self.copies.get(target, ())
        ]


Message = Frame | AirFrame
PROMISE_ONLY = -1


def promise(incarnation: int, promise_ns: int, sent: int, progress_ns: int = 0, interventions: int = 0) -> Frame:
    """A promise without a frame, from an agent that has handled everything before `progress_ns`."""
    return Frame(incarnation, PROMISE_ONLY, progress_ns, 0, 0, "", b"", sent, promise_ns, 0, interventions)


def air_promise(incarnation: int, promise_ns: int, sent: int, progress_ns: int = 0, interventions: int = 0) -> AirFrame:
    """A radio's promise without a transmission, to all its neighbours."""
    return AirFrame(incarnation, PROMISE_ONLY, progress_ns, 0, b"", sent, promise_ns, {}, (), interventions)


def encode(frame: Message) -> bytes:
    """Encode a frame: version, CRC-32 of the body, body."""
    body: bytes = msgpack.packb(frame)
    return _HEAD.pack(VERSION, zlib.crc32(body)) + body


def decode(data: bytes) -> Message:
    """Decode a frame.

    Raises:
        DamagedFrame: another version, a wrong checksum, or not a frame.
    """
    if len(data) <= _HEAD.size or data[0] != VERSION:
        raise DamagedFrame(f"frame of {len(data)} bytes, first byte {data[:1].hex() or 'none'}: not version {VERSION}")
    body = data[_HEAD.size :]
    if zlib.crc32(body) != _HEAD.unpack_from(data)[1]:
        raise DamagedFrame(f"frame of {len(data)} bytes: the checksum does not fit")
    try:
        fields = msgpack.unpackb(body, use_list=False)
    except (ValueError, msgpack.UnpackException) as error:
        raise DamagedFrame(f"frame of {len(data)} bytes: not MessagePack ({error})") from error
    if isinstance(fields, tuple) and len(fields) == len(Frame._fields):
        return Frame(*fields)
    if isinstance(fields, tuple) and len(fields) == len(AirFrame._fields):
        return AirFrame(*fields)
    raise DamagedFrame(f"frame of {len(data)} bytes: not {len(Frame._fields)} or {len(AirFrame._fields)} fields")
