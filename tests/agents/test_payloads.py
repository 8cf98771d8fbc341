"""Payloads: plain values and arrays in the precision that was asked for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from volery.agents.payloads import DamagedPayload, Precision, decode, encode
from volery.errors import BadInput

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


@pytest.mark.parametrize("value", [np.zeros((2, 2)), object(), [np.zeros((1, 1))], {1}, 1j, np.array(["a"]), [[1j]]])
@pytest.mark.parametrize("precision", sorted(BYTES))
def test_other_values_are_refused(value: object, precision: Precision) -> None:
    """Only plain values and vectors travel."""
    with pytest.raises(BadInput, match=r"plain values and one-dimensional arrays, not .* of type"):
        encode(value, precision)


def test_whole_numbers_have_at_most_64_bits() -> None:
    """As MessagePack has them."""
    assert decode(encode(2**64 - 1)) == 2**64 - 1
    with pytest.raises(BadInput, match="one-dimensional arrays, not 18446744073709551616 of more than 64 bits"):
        encode([2**64])


floats = st.floats(width=16, allow_nan=False)
plain = st.recursive(
    floats | st.integers(-(2**63), 2**64 - 1) | st.booleans() | st.none() | st.text(max_size=3) | st.binary(max_size=3),
    lambda each: (
        st.lists(each, max_size=4) | st.dictionaries(st.text(max_size=2) | st.integers(0, 9), each, max_size=3)
    ),
    max_leaves=8,
)


@given(plain, st.sampled_from(sorted(BYTES)))
def test_plain_values_come_back_in_every_precision(value: object, precision: Precision) -> None:
    """Of the same types; floats that the precision holds are the same."""
    got = decode(encode(value, precision))
    assert got == value
    assert repr(got) == repr(value)


@pytest.mark.parametrize(("precision", "size"), [("float64", 46), ("float32", 23), ("float16", 13)])
def test_floats_of_a_list_have_the_precision_that_is_asked_for(precision: Precision, size: int) -> None:
    """Five floats in a list are as short as in an array, and a single one takes its bytes and two more."""
    values = [0.1, -2.5, 3.0, 1e-3, 7.0]
    packed = encode(values, precision)
    assert len(packed) == size
    assert decode(packed) == np.array(values, precision).astype(float).tolist()
    assert len(encode(0.1, precision)) == {"float64": 9, "float32": 6, "float16": 4}[precision]
    assert decode(encode([1, 0.1, "a"], precision)) == [1, float(np.array(0.1, precision)), "a"]


@pytest.mark.parametrize("precision", sorted(BYTES))
def test_numbers_of_numpy_are_plain(precision: Precision) -> None:
    """As an agent finds them in its arrays."""
    got = decode(encode({"a": np.float32(0.5), "b": np.int64(3), "c": np.True_, "d": [np.float64(0.5)]}, precision))
    assert repr(got) == "{'a': 0.5, 'b': 3, 'c': True, 'd': [0.5]}"


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x93\x01", b"\xc7\x03\x08abc", b"\xc7\x01\x63a", b"\x01\x02"])
def test_bytes_that_are_no_payload_are_refused(data: bytes) -> None:
    """Cut off, too long, an array of half a number, an unknown extension."""
    with pytest.raises(DamagedPayload, match=rf"{len(data)} bytes that are no payload"):
        decode(data)
