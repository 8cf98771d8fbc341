"""The wire format of a frame: version, checksum, MessagePack. No pickle, nothing that can run code.

A frame carries its own story: when it started, how long it was on the air, when it is due and what the sender's link
did to it. Frames that the link lost travel too, without their payload, so that sequence numbers have no gaps but those
of the middleware, and half-duplex can be decided where it belongs. What a radio transmits is put once for all that hear
it, with the story for each of its targets.
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

VERSION = 3
_HEAD = struct.Struct("<BI")


class DamagedFrame(VoleryError):
    """Bytes that are no frame of this version, or whose checksum does not fit."""


class Frame(NamedTuple):
    """One frame on the link, or a bare promise (`sequence` is then −1 and nothing is delivered).

    `promise_ns`: no later frame of this link starts before that instant; None where nothing is promised.
    `sent`: frames of this link and incarnation put so far, this one included. `copy` is 1 for a duplicate.
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


class AirFrame(NamedTuple):
    """What a radio transmitted, or a bare promise (`sequence` is then −1): heard by all its neighbours.

    `sequence` counts the radio's transmissions. `copies`: target → its arrivals. `shaded`: the
    neighbours that hear nothing of it, because their link is cut or not there. `sent` and `promise_ns` as in `Frame`.
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

    @property
    def due_ns(self) -> int:
        """When the first of its arrivals is due; its start, where there is none."""
        return min(
            (due_ns for arrivals in self.copies.values() for _, _, _, due_ns, _ in arrivals), default=self.start_ns
        )

    def for_target(self, target: str) -> list[Frame]:
        """The frames that arrive at one neighbour."""
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


def promise(incarnation: int, promise_ns: int, sent: int) -> Frame:
    """A frame that carries nothing but a promise."""
    return Frame(incarnation, PROMISE_ONLY, 0, 0, 0, "", b"", sent, promise_ns)


def air_promise(incarnation: int, promise_ns: int, sent: int) -> AirFrame:
    """The promise of a radio, to all that hear it."""
    return AirFrame(incarnation, PROMISE_ONLY, 0, 0, b"", sent, promise_ns, {}, ())


def encode(frame: Message) -> bytes:
    """Bytes of a frame: version, CRC-32 of the body, the body."""
    body: bytes = msgpack.packb(frame)
    return _HEAD.pack(VERSION, zlib.crc32(body)) + body


def decode(data: bytes) -> Message:
    """The frame in these bytes.

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
