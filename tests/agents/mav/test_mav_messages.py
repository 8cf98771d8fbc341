"""Messages of a formation on the air: sizes, round trips, stamps that wrap, bounds that hold, damage."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.agents.mav.mav_messages import Kind, Layout, decode, encode
from volery.agents.payloads import DamagedPayload, Precision
from volery.errors import BadInput
from volery.estimators.formation.formation_messages import FullMessage, Message, PairMessage
from volery.randomness import stream

PRECISIONS: tuple[Precision, ...] = get_args(Precision)
SECOND = 1_000_000_000


def numbers(seed: int, size: int) -> NDArray[np.float64]:
    """Of about the size of positions in a formation."""
    draws = stream(seed, "test", "messages")
    return np.array([draws.normal(i) for i in range(size)])


def covariance_of(size: int, seed: int) -> NDArray[np.float64]:
    """Positive definite, with deviations of centimetres and decimetres a second."""
    root = numbers(seed, size * size).reshape(size, size)
    scale = np.tile(np.repeat([0.01, 0.1], 3), size // 6)
    matrix: NDArray[np.float64] = np.outer(scale, scale) * (root @ root.T / size + 0.01 * np.eye(size))
    return matrix


def message_of(layout: Layout, seed: int = 1, time_ns: int = 7 * SECOND) -> Message:
    """One that has all that a layout may ask for."""
    values, covariance = numbers(seed, layout.values), covariance_of(layout.values, seed)
    if layout.kind == "full":
        return FullMessage(2, time_ns, values, covariance)
    attitude = numbers(seed + 1, 4)
    return PairMessage(2, 0, time_ns, values, 40_000_000, attitude / np.linalg.norm(attitude), covariance)


@pytest.mark.parametrize(
    ("layout", "size"),
    [
        (Layout("pair", 3), 50),
        (Layout("full", 3), 50),
        (Layout("pair", 3, attitude=False), 34),
        (Layout("pair", 30, "float16"), 30),
        (Layout("pair", 3, "float64"), 90),
        (Layout("full", 5, "float16"), 50),
        (Layout("pair", 3, covariance="bound"), 58),
        (Layout("pair", 3, "float16", covariance="bound"), 34),
        (Layout("pair", 3, covariance="whole"), 134),
        (Layout("full", 3, covariance="bound"), 66),
        (Layout("full", 3, covariance="whole"), 362),
    ],
)
def test_sizes_on_the_air_are_those_of_the_paper_and_what_a_covariance_adds(layout: Layout, size: int) -> None:
    """50 bytes for either kind of three vehicles in float32; a bound costs 8 bytes more, the whole covariance 84."""
    assert layout.size == size == len(encode(layout, message_of(layout)))


@pytest.mark.parametrize("told", ["none", "bound", "whole"])
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("kind", ["pair", "full"])
def test_what_is_decoded_is_what_was_encoded_to_the_precision(kind: Kind, precision: Precision, told: str) -> None:
    """Numbers within half a unit in the last place, stamps within their unit, arrays fresh and writable."""
    layout = Layout(kind, 3, precision, covariance=told)  # type: ignore[arg-type]
    sent = message_of(layout)
    got = decode(layout, encode(layout, sent), sender=2, now_ns=8 * SECOND)
    digits = {"float64": 1e-15, "float32": 6e-8, "float16": 5e-4}[precision]
    np.testing.assert_allclose(got.values, sent.values, rtol=digits)
    assert got.time_ns == sent.time_ns
    assert got.pairs == sent.pairs
    assert got.unseen_ns == sent.unseen_ns
    assert got.values.flags.writeable
    assert got.values.flags.owndata
    if isinstance(sent, PairMessage) and isinstance(got, PairMessage):
        assert got.attitude is not None
        assert sent.attitude is not None
        np.testing.assert_allclose(got.attitude, sent.attitude, rtol=digits, atol=1e-7)
    assert (got.covariance is None) == (told == "none")
    if got.covariance is not None and sent.covariance is not None and told == "whole":
        # Enlarged by a unit for each of k numbers in a row, two for the deviation, and by what rounding moves the
        # values.
        unit = {"float64": 2.3e-16, "float32": 1.2e-7, "float16": 9.8e-4}[precision]
        moved = layout.values * (unit / 2 * sent.values) ** 2
        scale = np.sqrt(sent.covariance.diagonal() + moved)
        slack = (layout.values + 4) * unit * np.outer(scale, scale) + np.diag(moved)
        assert (np.abs(got.covariance - sent.covariance) <= slack).all()


@settings(max_examples=30)
@given(
    kind=st.sampled_from(["pair", "full"]),
    precision=st.sampled_from(PRECISIONS),
    told=st.sampled_from(["bound", "whole"]),
    seed=st.integers(0, 10_000),
)
def test_a_covariance_that_arrives_is_never_smaller_than_what_was_sent(
    kind: Kind, precision: Precision, told: str, seed: int
) -> None:
    """Not even by what the values lose to rounding; tolerance: rounding of the eigenvalues."""
    layout = Layout(kind, 3, precision, covariance=told)  # type: ignore[arg-type]
    sent = message_of(layout, seed)
    got = decode(layout, encode(layout, sent), sender=2, now_ns=7 * SECOND)
    assert sent.covariance is not None
    assert got.covariance is not None
    lost = got.values - sent.values
    scale = np.sqrt(sent.covariance.diagonal())
    short = (got.covariance - sent.covariance - np.outer(lost, lost)) / np.outer(scale, scale)
    assert np.linalg.eigvalsh(short).min() > -1e-12


@settings(max_examples=60)
@given(
    kind=st.sampled_from(["pair", "full"]),
    sent_ns=st.integers(0, 10**16),
    age_ns=st.integers(-30 * SECOND, 30 * SECOND),
)
def test_a_stamp_that_has_wrapped_is_the_instant_nearest_to_now(kind: Kind, sent_ns: int, age_ns: int) -> None:
    """Up to 32 s either way for `full`, six days for `pair`; rounded down to its unit."""
    layout = Layout(kind, 3)
    got = decode(layout, encode(layout, message_of(layout, time_ns=sent_ns)), sender=2, now_ns=sent_ns + age_ns)
    unit_ns = 1_000 if kind == "pair" else 1_000_000
    assert got.time_ns == sent_ns // unit_ns * unit_ns


def test_a_vehicle_that_was_not_seen_for_long_is_said_to_be_so_at_the_end_of_the_scale() -> None:
    """65.535 s, and rounded up to a millisecond."""
    layout = Layout("pair", 3, attitude=False)
    for unseen_ns, expected in ((1, 1_000_000), (10**12, 65_535_000_000)):
        sent = PairMessage(0, 1, 0, np.zeros(6), unseen_ns)
        assert decode(layout, encode(layout, sent), sender=0, now_ns=0).unseen_ns == expected


def test_a_packet_that_is_too_small_is_refused_with_what_fits() -> None:
    """`full` of four in 50 bytes, a bound beside attitude in float32; where nothing fits, larger packets alone."""
    Layout("full", 3).check_fits(50)
    with pytest.raises(
        BadInput, match=r"50 B is too small for `full` of 4 vehicles in float32, 74 B: .* float16 has 38 B"
    ):
        Layout("full", 4).check_fits(50)
    with pytest.raises(
        BadInput, match=r"attitude and a bound of the covariance, 58 B: .* with attitude and a bound .* 34 B"
    ):
        Layout("pair", 3, covariance="bound").check_fits(50)
    with pytest.raises(BadInput, match=r"larger packets$"):
        Layout("pair", 3).check_fits(10)
    for vehicles in (1, 257):
        with pytest.raises(BadInput, match="2 to 256"):
            Layout("pair", vehicles)


def test_a_message_that_lacks_what_the_layout_has_is_refused() -> None:
    """Attitude, covariance, the kind itself."""
    plain = PairMessage(0, 1, 0, np.zeros(6))
    with pytest.raises(BadInput, match="attitude"):
        encode(Layout("pair", 3), plain)
    with pytest.raises(BadInput, match="bound covariance"):
        encode(Layout("pair", 3, attitude=False, covariance="bound"), plain)
    with pytest.raises(BadInput, match="in a layout of `full`"):
        encode(Layout("full", 3), plain)


def test_damaged_bytes_are_told_from_messages() -> None:
    """Another length, kind, sender or vehicle; numbers that are not finite; a covariance that is none."""
    layout = Layout("pair", 3, covariance="whole")
    good = bytearray(encode(layout, message_of(layout)))
    decode(layout, bytes(good), sender=2, now_ns=0)
    wrong = {0: 9, 1: 1, 2: 3}
    damaged = [bytes([*good[:at], byte, *good[at + 1 :]]) for at, byte in wrong.items()]
    damaged += [bytes(good[:-1]), bytes(good[:10]) + b"\xff" * (len(good) - 10)]
    damaged.append(bytes(good[:50]) + np.zeros(21, dtype="<f4").tobytes())
    for payload in damaged:
        with pytest.raises(DamagedPayload):
            decode(layout, payload, sender=2, now_ns=0)
