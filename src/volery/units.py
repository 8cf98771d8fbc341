"""Quantities with units: read and write "20 Hz", "2 ms", "115.2 kbit/s", "5 deg", and mark the units of fields.

A field's type names its unit, e.g. `rate: Hertz`, `latency: Nanoseconds`. The scenario reader converts text to the
number in that unit; it refuses a plain number where a unit is needed, so that ms and s are not confused.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, get_args, get_type_hints

from .errors import BadInput

_DEGREE = math.pi / 180
_SCALES: dict[str, dict[str, Fraction | float]] = {
    "ns": {
        "ns": Fraction(1),
        "us": Fraction(10**3),
        "µs": Fraction(10**3),
        "ms": Fraction(10**6),
        "s": Fraction(10**9),
        "min": Fraction(60 * 10**9),
        "h": Fraction(3600 * 10**9),
    },
    "s": {
        "us": Fraction(1, 10**6),
        "µs": Fraction(1, 10**6),
        "ms": Fraction(1, 1000),
        "s": Fraction(1),
        "min": Fraction(60),
        "h": Fraction(3600),
    },
    "Hz": {"mHz": Fraction(1, 1000), "Hz": Fraction(1), "kHz": Fraction(1000)},
    "bit/s": {"bit/s": Fraction(1), "kbit/s": Fraction(10**3), "Mbit/s": Fraction(10**6)},
    "B": {"B": Fraction(1), "kB": Fraction(10**3)},
    "m": {"mm": Fraction(1, 1000), "cm": Fraction(1, 100), "m": Fraction(1), "km": Fraction(1000)},
    "m/s": {"mm/s": Fraction(1, 1000), "m/s": Fraction(1), "km/h": Fraction(1000, 3600)},
    "m/s²": {"mm/s²": Fraction(1, 1000), "m/s²": Fraction(1), "m/s2": Fraction(1)},
    "m/√s": {"mm/√s": Fraction(1, 1000), "cm/√s": Fraction(1, 100), "m/√s": Fraction(1), "m/sqrt(s)": Fraction(1)},
    "m/s/√s": {"m/s/√s": Fraction(1), "m/s/sqrt(s)": Fraction(1)},
    "m/s²/√s": {"m/s²/√s": Fraction(1), "m/s2/sqrt(s)": Fraction(1)},
    "rad/s": {"rad/s": Fraction(1), "mrad/s": Fraction(1, 1000), "deg/s": _DEGREE},
    "rad/s/√s": {"rad/s/√s": Fraction(1), "deg/s/√s": _DEGREE, "rad/s/sqrt(s)": Fraction(1)},
    "/s": {"/s": Fraction(1)},
    "kg": {"g": Fraction(1, 1000), "kg": Fraction(1)},
    "rad": {"rad": Fraction(1), "mrad": Fraction(1, 1000), "deg": _DEGREE},
    "kg m²": {"g m²": Fraction(1, 1000), "kg m²": Fraction(1), "kg m2": Fraction(1)},
    "N m": {"mN m": Fraction(1, 1000), "N m": Fraction(1)},
    "G": {"mG": Fraction(1, 1000), "G": Fraction(1)},
    "V": {"mV": Fraction(1, 1000), "V": Fraction(1)},
    "dB": {"dB": Fraction(1)},
    "dBm": {"dBm": Fraction(1)},
    "ppb": {"ppb": Fraction(1), "ppm": Fraction(1000)},
}
GREEK_MU = "μ"
"""U+03BC, which keyboards and editors write for the micro sign U+00B5 that is in the table."""
_WHOLE = ("ns", "B", "ppb")
_UNSIGNED = ("Hz", "bit/s", "B", "kg", "kg m²", "/s")
_WRITTEN_IN = {
    "ns": ("s", "ms", "us", "ns"),
    "bit/s": ("Mbit/s", "kbit/s", "bit/s"),
    "rad": ("deg", "rad"),
    "ppb": ("ppm", "ppb"),
}
"""Units that `quantity` chooses from, where there are several."""
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d].*?)?\s*")


def parse(text: str, unit: str) -> float | int:
    """Read a quantity such as "2.5 ms" as a number in `unit`; nanoseconds, bytes and ppb are returned as integers.

    Raises:
        BadInput: not a number with a unit, or a unit of another dimension; the message lists the allowed units.
    """
    scales = _SCALES[unit]
    match = _QUANTITY.fullmatch(text.replace(GREEK_MU, "µ"))
    if match is None or match[2] not in scales:
        raise BadInput(f"{text!r} is not a quantity here: write a number and one of {', '.join(scales)}")
    scale = scales[match[2]]
    try:
        value = Fraction(match[1]) * scale if isinstance(scale, Fraction) else Fraction(float(match[1]) * scale)
        return round(value) if unit in _WHOLE else float(value)
    except OverflowError:
        raise BadInput(f"{text!r} is not finite") from None


def quantity(value: float, unit: str) -> str:
    """Text such as "2.5 ms" that `parse` reads as exactly this value, in the unit with the shortest text."""
    exact = f"{value!r} {unit}"
    texts = [f"{_number(value, name, unit)} {name}" for name in _WRITTEN_IN.get(unit, (unit,))]
    return min((text for text in (*texts, exact) if parse(text, unit) == value), key=len)


def _number(value: float, name: str, unit: str) -> str:
    scaled = Fraction(value) / Fraction(parse(f"1 {name}", unit))
    return str(scaled.numerator) if scaled.denominator == 1 else repr(float(scaled)).removesuffix(".0")


@dataclass(frozen=True)
class Unit:
    """Marks a field's unit, as in `Annotated[float, Unit("Hz")]`; `bare`: plain numbers in this unit are allowed."""

    name: str
    bare: bool = False

    def read(self, value: object) -> float | int:
        """The number in this unit: text is parsed; a plain number is refused unless it is 0 or `bare` is set.

        Raises:
            BadInput: not a quantity in this unit.
        """
        if isinstance(value, str):
            return parse(value, self.name)
        if isinstance(value, int | float) and not isinstance(value, bool):
            if value == 0:
                return 0 if self.name in _WHOLE else 0.0
            if self.bare and math.isfinite(value):
                return float(value)
        units = ", ".join(_SCALES[self.name])
        raise BadInput(f"{value!r} has no unit: write it with one of {units}")

    @property
    def signed(self) -> bool:
        """Whether quantities in this unit may be negative."""
        return self.name not in _UNSIGNED

    @property
    def names(self) -> tuple[str, ...]:
        """The units in which a quantity may be written."""
        return tuple(_SCALES[self.name])


OWNERS = Unit("")
"""Marks a number in the unit of the quantity that it belongs to, such as the amplitude of a signal."""


@dataclass(frozen=True)
class Bounds:
    """Marks the bounds of a number or quantity in its unit: `least` and `most` are included, the others are not."""

    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None

    def contain(self, value: float) -> bool:
        """Whether a number is within; NaN is not."""
        least = -math.inf if self.least is None else self.least
        most = math.inf if self.most is None else self.most
        return (
            least <= value <= most
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )

    @property
    def text(self) -> str:
        """As in "at least 0 and below 1"."""
        parts = {"at least": self.least, "above": self.above, "at most": self.most, "below": self.below}
        return " and ".join(f"{word} {end:g}" for word, end in parts.items() if end is not None)


@dataclass(frozen=True)
class OneOrMany:
    """Marks a tuple that may be written as a single item without a list, or as the word `none`, if given, if empty."""

    none: str | None = None


Probability = Annotated[float, Bounds(0.0, 1.0)]
Count = Annotated[int, Bounds(least=1)]
Nanoseconds = Annotated[int, Unit("ns")]
Duration = Annotated[Nanoseconds, Bounds(least=0)]
"""Nanoseconds, at least 0."""
Period = Annotated[Nanoseconds, Bounds(above=0)]
"""Nanoseconds, above 0."""
Hertz = Annotated[float, Unit("Hz"), Bounds(above=0.0)]
BitsPerSecond = Annotated[float, Unit("bit/s"), Bounds(above=0.0)]
Bytes = Annotated[int, Unit("B")]
PerSecond = Annotated[float, Unit("/s")]
Kilograms = Annotated[float, Unit("kg"), Bounds(above=0.0)]
Seconds = Annotated[float, Unit("s")]
Metres = Annotated[float, Unit("m")]
BareMetres = Annotated[float, Unit("m", bare=True)]
"""Metres, which may also be given as a plain number."""
MetresPerSecond = Annotated[float, Unit("m/s")]
MetresPerSecondSquared = Annotated[float, Unit("m/s²")]
MetresPerRootSecond = Annotated[float, Unit("m/√s")]
MetresPerSecondPerRootSecond = Annotated[float, Unit("m/s/√s")]
MetresPerSecondSquaredPerRootSecond = Annotated[float, Unit("m/s²/√s")]
Radians = Annotated[float, Unit("rad")]
RadiansPerSecond = Annotated[float, Unit("rad/s")]
RadiansPerSecondPerRootSecond = Annotated[float, Unit("rad/s/√s")]
KilogramSquareMetres = Annotated[float, Unit("kg m²")]
NewtonMetres = Annotated[float, Unit("N m")]
Gauss = Annotated[float, Unit("G")]
Volts = Annotated[float, Unit("V")]
Decibels = Annotated[float, Unit("dB")]
DecibelMilliwatts = Annotated[float, Unit("dBm")]
PartsPerBillion = Annotated[int, Unit("ppb")]


def unit_of(hint: Any) -> str | None:
    """The unit of an annotated type, or of one member of a union."""
    for mark in getattr(hint, "__metadata__", ()):
        if isinstance(mark, Unit):
            return mark.name
    return next((unit for part in get_args(hint) if (unit := unit_of(part))), None)


def within_bounds(settings: Any) -> Any:
    """Return a dataclass if its numbers are within the bounds that their types are marked with.

    Raises:
        BadInput: the first such field; the message gives its name and bounds.
    """
    for name, hint in get_type_hints(type(settings), include_extras=True).items():
        bounds = next((mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, Bounds)), None)
        value = getattr(settings, name, None)
        if bounds is not None and isinstance(value, int | float) and not bounds.contain(value):
            unit = unit_of(hint)
            raise BadInput(f"{name} is {value:g}{(unit and f' {unit}') or ''}, it must be {bounds.text}", (name,))
    return settings


def check_above_zero(name: str, value: float, unit: str = "") -> None:
    """Refuse a number that is not finite and above 0.

    Raises:
        BadInput: the message gives name, value and unit.
    """
    if not 0 < value < math.inf:
        raise BadInput(f"{name} is {value:g}{unit and f' {unit}'}, it must be above 0 and finite")


def check_fields_above_zero(parameters: object, *names: str) -> None:
    """Refuse fields of a dataclass that are not finite and above 0, except None; the unit is that of the type.

    Raises:
        BadInput: as `check_above_zero`, for the first such field.
    """
    hints = get_type_hints(type(parameters), include_extras=True)
    for name in names:
        value = getattr(parameters, name)
        if value is not None:
            check_above_zero(name, value, unit_of(hints[name]) or "")


def period_ns(rate_hz: float, index: int) -> int:
    """Nominal start of the index-th period of a rate: floor(index·10⁹ / rate), exactly."""
    numerator, denominator = rate_hz.as_integer_ratio()
    return index * 1_000_000_000 * denominator // numerator


SampleTimes = float | tuple[int, ...]
"""When a sensor samples: at a rate [Hz] from 0 on, or at instants [ns] in ascending order."""


def sample_ns(times: SampleTimes, index: int) -> int | None:
    """Instant of the index-th sample; None where there are not so many."""
    if isinstance(times, tuple):
        return times[index] if index < len(times) else None
    return period_ns(times, index)


def first_sample(times: SampleTimes, from_ns: int) -> int:
    """Index of the first sample at `from_ns` or later."""
    return bisect_left(times, from_ns) if isinstance(times, tuple) else first_period(times, from_ns)


def first_period(rate_hz: float, from_ns: int) -> int:
    """Index of the first period of a rate that starts at `from_ns` or later."""
    index = int(from_ns * rate_hz / 1e9)
    while index > 0 and period_ns(rate_hz, index - 1) >= from_ns:
        index -= 1
    while period_ns(rate_hz, index) < from_ns:
        index += 1
    return index
