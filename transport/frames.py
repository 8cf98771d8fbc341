"""The wire format of a frame: version, checksum, MessagePack. No pickle, nothing that can run code.

A frame carries its own story: when it started, how long it was on the air, when it is due and what the sender's link
did to it. Frames that the link lost travel too, without their payload, so that sequence numbers have no gaps but those
of the middleware, and half-duplex can be decided where it belongs.
"""

from __future__ import annotations

import zlib
from typing import NamedTuple

import msgpack

from ..errors import VoleryError

VERSION = 1
_HEAD = 5
_FIELDS = 9


class DamagedFrame(VoleryError):
    """Bytes that are no frame of this version, or whose checksum does not fit."""


class Frame(NamedTuple):
    """One frame on the link, or a bare promise (`sequence` is then −1 and nothing is delivered).

    `promise_ns`: no later frame of this link starts before that instant; None outside lockstep pace.
    `sent`: frames of this link and incarnation put so far, this one included.
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


PROMISE_ONLY = -1


def promise(incarnation: int, promise_ns: int, sent: int) -> Frame:
    """A frame that carries nothing but a promise."""
    return Frame(incarnation, PROMISE_ONLY, 0, 0, 0, "", b"", sent, promise_ns)


def encode(frame: Frame) -> bytes:
    """Bytes of a frame: version, CRC-32 of the body, the body."""
    body: bytes = msgpack.packb(frame)
    return bytes((VERSION,)) + zlib.crc32(body).to_bytes(4, "little") + body


def decode(data: bytes) -> Frame:
    """The frame in these bytes.

    Raises:
        DamagedFrame: another version, a wrong checksum, or not a frame.
    """
    if len(data) <= _HEAD or data[0] != VERSION:
        raise DamagedFrame(f"frame of {len(data)} bytes, first byte {data[:1].hex() or 'none'}: not version {VERSION}")
    body = data[_HEAD:]
    if zlib.crc32(body) != int.from_bytes(data[1:_HEAD], "little"):
        raise DamagedFrame(f"frame of {len(data)} bytes: the checksum does not fit")
    try:
        fields = msgpack.unpackb(body)
    except (ValueError, msgpack.UnpackException) as error:
        raise DamagedFrame(f"frame of {len(data)} bytes: not MessagePack ({error})") from error
    if not isinstance(fields, list) or len(fields) != _FIELDS:
        raise DamagedFrame(f"frame of {len(data)} bytes: not {_FIELDS} fields")
    return Frame(*fields)
