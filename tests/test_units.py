"""Bounds of fields: what is refused, and in which unit that is said."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest

from volery.errors import BadInput
from volery.units import Hertz, Metres, check_fields_above_zero, parse


@dataclass(frozen=True)
class Parameters:
    """A rate, a length that may be missing, and a number without a unit."""

    rate: Hertz = 1.0
    length: Metres | None = 1.0
    gain: float = 1.0


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        (Parameters(rate=0.0), "rate is 0 Hz"),
        (Parameters(length=-2.5), "length is -2.5 m"),
        (Parameters(gain=math.inf), "gain is inf"),
        (Parameters(rate=math.nan), "rate is nan Hz"),
    ],
)
def test_what_is_not_above_zero_and_finite_is_refused_in_the_unit_of_its_field(
    parameters: Parameters, said: str
) -> None:
    """By name, value and unit; a field that is not asked about may be anything, one that may be missing None."""
    with pytest.raises(BadInput, match=f"^{said}, it must be above 0 and finite$"):
        check_fields_above_zero(parameters, "rate", "length", "gain")
    check_fields_above_zero(parameters, *({"rate", "length", "gain"} - {said.split(maxsplit=1)[0]}))
    check_fields_above_zero(Parameters(length=None), "rate", "length", "gain")


def test_micro_is_read_in_both_forms() -> None:
    """The micro sign U+00B5 and the Greek letter U+03BC, which look alike, mean the same."""
    assert parse("5 \u00b5s", "ns") == parse("5 \u03bcs", "ns") == 5_000
    assert parse("5 \u03bcs", "s") == 5e-6
