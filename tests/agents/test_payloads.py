"""Payloads: plain values and arrays in the precision that was asked for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from volery.agents.payloads import DamagedPayload, Precision, decode, encode

BYTES: dict[Precision, int] = {"float64": 8, "float32": 4, "float16": 2}
vectors = arrays.arrays(np.float64, st.integers(0, 30), elements=st.floats(-6e4, 6e4))


@given(vectors, st.sampled_from(sorted(BYTES)), st.integers(0, 2**16), st.text(max_size=5))
def test_arrays_come_back_rounded_to_their_precision(
    vector: np.ndarray, precision: Precision, number: int, text: str
) -> None:
    """Numbers and text come back as they were, arrays as float64 of what the precision holds, fresh and contiguous."""
    got_number, got_text, got = decode(encode([number, text, vector], precision))
    assert (got_number, got_text) == (number, text)
    np.testing.assert_array_equal(got, vector.astype(precision).astype(np.float64), strict=True)
    assert got.flags.owndata
    assert got.flags.c_contiguous
    assert got.flags.writeable


@pytest.mark.parametrize("precision", sorted(BYTES))
def test_size_follows_precision(precision: Precision) -> None:
    """Beside a head of at most 6 bytes, an array takes its numbers' bytes and nothing else."""
    sizes = [len(encode(np.zeros(count), precision)) for count in (9, 18)]
    assert 0 < sizes[0] - 9 * BYTES[precision] <= 6
    assert sizes[1] - sizes[0] in range(9 * BYTES[precision], 9 * BYTES[precision] + 2)


def test_bits_are_little_endian_on_every_machine() -> None:
    """The numbers of a payload are the same bytes everywhere."""
    assert encode(np.array([1.5]), "float64").endswith(b"\x00\x00\x00\x00\x00\x00\xf8\x3f")


@pytest.mark.parametrize("value", [np.zeros((2, 2)), object(), [np.zeros((1, 1))]])
def test_other_values_are_refused(value: object) -> None:
    """Only plain values and vectors travel."""
    with pytest.raises(TypeError, match="plain values and one-dimensional arrays"):
        encode(value)


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x93\x01", b"\xc7\x03\x08abc", b"\xc7\x01\x63a", b"\x01\x02"])
def test_bytes_that_are_no_payload_are_refused(data: bytes) -> None:
    """Cut off, too long, an array of half a number, an unknown extension."""
    with pytest.raises(DamagedPayload, match=rf"{len(data)} bytes that are no payload"):
        decode(data)
