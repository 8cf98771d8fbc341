"""Reading of the `world:` mapping of a scenario: what its kinds share."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from ..errors import BadInput
from ..names import did_you_mean
from ..units import Unit


def quantity(value: object, unit: str, place: str) -> float:
    """A finite number in a unit, from text such as "2 m".

    Raises:
        BadInput: no such quantity, or not finite.
    """
    with at(place):
        number = Unit(unit).read(value)
    if not math.isfinite(number):
        raise BadInput(f"{place}: {value!r} is not finite")
    return number


@contextmanager
def at(place: str) -> Iterator[None]:
    """Put the place before the message of what is refused inside."""
    try:
        yield
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from None


def required(spec: Mapping[str, Any], key: str, place: str) -> Any:
    """What stands under a key.

    Raises:
        BadInput: nothing does.
    """
    if key not in spec:
        raise BadInput(f"{place}: {key} is missing")
    return spec[key]


def check_keys(spec: Mapping[str, Any], known: Collection[str], place: str) -> None:
    """Check every key of a mapping.

    Raises:
        BadInput: an unknown one, with the nearest that is known.
    """
    for key in spec:
        choice(key, known, place)


def choice(word: object, known: Collection[str], place: str) -> None:
    """Check a word.

    Raises:
        BadInput: it is not known, with the nearest that is.
    """
    if word not in known:
        raise BadInput(f"{place}: {word!r} is not known{did_you_mean(str(word), known)}")
