"""The wire format."""

from __future__ import annotations

import zlib

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.transport.frames import PROMISE_ONLY, VERSION, AirFrame, DamagedFrame, Frame, decode, encode, promise
from volery.transport.propagation import Copy

whole = st.integers(0, 2**62)
frames = st.builds(
    Frame,
    incarnation=st.integers(0, 2**14),
    sequence=st.integers(0, 2**48 - 1),
    start_ns=whole,
    airtime_ns=whole,
    due_ns=whole,
    verdict=st.sampled_from(["delivered", "cut", "loss"]),
    payload=st.binary(max_size=60),
    sent=whole,
    promise_ns=st.none() | whole,
    copy=st.integers(0, 1),
)
names = st.text("ab1", min_size=1, max_size=3)
copies = st.builds(Copy, names, st.integers(0, 2**48), st.integers(0, 1), whole, st.sampled_from(["delivered", "loss"]))
air_frames = st.builds(
    AirFrame,
    incarnation=st.integers(0, 2**14),
    sequence=st.integers(-1, 2**48),
    start_ns=whole,
    airtime_ns=whole,
    payload=st.binary(max_size=60),
    sent=whole,
    promise_ns=st.none() | whole,
    copies=st.dictionaries(names, st.lists(copies, max_size=2).map(tuple), max_size=4),
    shaded=st.lists(names, max_size=3).map(tuple),
    interventions=st.integers(0, 1000),
)


@given(frames)
def test_a_frame_comes_back_as_it_was(frame: Frame) -> None:
    """Every field, with its type."""
    assert decode(encode(frame)) == frame


@given(air_frames, names)
def test_what_a_radio_sends_comes_back_with_what_arrives_where(air: AirFrame, target: str) -> None:
    """Every field; each target gets its own arrivals, the payload only where nothing has happened to it."""
    assert decode(encode(air)) == air
    arrivals = air.for_target(target)
    assert [(one.sequence, one.copy, one.due_ns, one.verdict) for one in arrivals] == [
        tuple(copy)[1:] for copy in air.copies.get(target, ())
    ]
    assert all(one.payload == (air.payload if one.verdict == "delivered" else b"") for one in arrivals)
    assert air.due_ns == min((copy.due_ns for one in air.copies.values() for copy in one), default=air.start_ns)


@given(whole, whole)
def test_a_promise_comes_back_as_it_was(promise_ns: int, sent: int) -> None:
    """It is a frame that is not delivered."""
    bare = decode(encode(promise(2, promise_ns, sent)))
    assert (bare.sequence, bare.promise_ns, bare.sent, bare.incarnation) == (PROMISE_ONLY, promise_ns, sent, 2)


@given(frames)
def test_every_flipped_bit_is_caught(frame: Frame) -> None:
    """CRC-32 finds any single wrong bit, wherever it is."""
    data = encode(frame)
    for place in range(len(data) * 8):
        damaged = bytearray(data)
        damaged[place // 8] ^= 1 << place % 8
        with pytest.raises(DamagedFrame):
            decode(bytes(damaged))


@given(frames)
def test_a_cut_off_frame_is_caught(frame: Frame) -> None:
    """No beginning of a frame is a frame, and neither is one with something behind it."""
    data = encode(frame)
    for length in range(len(data)):
        with pytest.raises(DamagedFrame):
            decode(data[:length])
    with pytest.raises(DamagedFrame):
        decode(data + b"\0")


@pytest.mark.parametrize("version", [0, VERSION + 1, 255])
def test_another_version_is_refused(version: int) -> None:
    """The message names both."""
    data = bytes([version]) + encode(promise(0, 0, 0))[1:]
    with pytest.raises(DamagedFrame, match=f"first byte {version:02x}: not version {VERSION}"):
        decode(data)


@pytest.mark.parametrize("body", [b"\xc1", b"\x93\x01", msgpack.packb(1), msgpack.packb([1, 2]), msgpack.packb({})])
def test_something_else_with_a_checksum_is_refused(body: bytes) -> None:
    """Not MessagePack, not a list, or not as many fields as a frame has."""
    with pytest.raises(DamagedFrame, match=r"not MessagePack|not 11 or 10 fields"):
        decode(bytes([VERSION]) + zlib.crc32(body).to_bytes(4, "little") + body)
