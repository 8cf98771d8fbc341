"""Checks of what an agent gives to its context, at the call: each error names the call, the value and the remedy.

Values are converted where nothing is lost: numpy integers are integers, numpy scalars are numbers, arrays in plain
values become lists.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import index
from reprlib import repr as shortened
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInput

_LARGEST = 2**63 - 1
_ROUNDING = 1e-6
"""What asymmetry and negative variances may come from rounding, relative to the largest entry of a covariance."""


def whole_number(value: Any, call: str, what: str) -> int:
    """An integer of Python or NumPy as int, of 64 bits."""
    if type(value) is not int:
        try:
            value = index(value)
        except TypeError:
            kind = type(value).__name__
            remedy = f"round it first, as in round({what})" if isinstance(value, float | np.floating) else "give an int"
            raise BadInput(
                f"{call}: {what} is {shortened(value)}, of type {kind}, and not a whole number: {remedy}"
            ) from None
    if not -_LARGEST <= value <= _LARGEST:
        raise BadInput(f"{call}: {what} is {value}, and has more than 64 bits")
    number: int = value
    return number


def text(value: Any, call: str, what: str) -> str:
    """A text, such as a name."""
    if not isinstance(value, str):
        raise BadInput(
            f"{call}: {what} is {shortened(value)}, of type {type(value).__name__}, and not a text: give a str"
        )
    if not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError:
            raise BadInput(f"{call}: {what} is {value!a}, which UTF-8 cannot encode: give another text") from None
    return value


def payload_bytes(value: Any, call: str) -> bytes:
    """Bytes of a payload; those that could still change are copied."""
    if isinstance(value, bytes):
        return value
    if isinstance(value, bytearray | memoryview):
        return bytes(value)
    kind = type(value).__name__
    raise BadInput(f"{call}: the payload is of type {kind}, and not bytes: encode it, as in payloads.encode(…)")


def numbers(value: ArrayLike, call: str, what: str) -> NDArray[np.float64]:
    """A float64 array of real numbers, of the same shape."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise BadInput(f"{call}: {what} is {shortened(value)}, whose rows differ in length: give one array") from None
    if array.dtype.kind not in "biuf":
        remedy = "give its real and imaginary parts" if array.dtype.kind == "c" else "give a number or an array of them"
        raise BadInput(f"{call}: {what} is {shortened(value)}, and not real numbers: {remedy}")
    if array.size == 0:
        raise BadInput(f"{call}: {what} has no number in it: leave the call out where there is nothing to say")
    return array.astype(np.float64, copy=False)


def finite_numbers(value: ArrayLike, call: str, what: str) -> NDArray[np.float64]:
    """The same, without NaN and infinities."""
    array = numbers(value, call, what)
    if not np.isfinite(array).all():
        raise BadInput(f"{call}: {what} is {shortened(array.tolist())}: every number must be finite")
    return array


def covariance(value: ArrayLike, call: str, what: str) -> NDArray[np.float64]:
    """A square matrix that is symmetric, with variances from 0 on, up to rounding."""
    matrix = np.atleast_2d(numbers(value, call, what))
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise BadInput(f"{call}: {what} has the shape {matrix.shape}: give a square matrix")
    with np.errstate(invalid="ignore"):  # infinite variances
        allowed = _ROUNDING * np.abs(matrix).max()
        if np.abs(matrix - matrix.T).max() > allowed:
            raise BadInput(f"{call}: {what} is not symmetric: {shortened(matrix.tolist())}")
        if matrix.diagonal().min() < -allowed:
            raise BadInput(f"{call}: {what} has the variance {matrix.diagonal().min():g}: variances are 0 or above")
    return matrix


def plain(value: Any, call: str, what: str, *, binary: bool = False) -> Any:
    """None, truth values, numbers, texts, and lists and mappings of them by text; bytes where `binary` allows it."""
    if isinstance(value, np.ndarray | np.bool_):
        value = value.tolist()
    if value is None or isinstance(value, bool) or (binary and isinstance(value, bytes)):
        return value
    if isinstance(value, str | int | np.integer):
        return text(value, call, what) if isinstance(value, str) else whole_number(value, call, what)
    if isinstance(value, float | np.floating):
        return float(value)
    if isinstance(value, list | tuple):
        return [plain(item, call, f"{what}[{place}]", binary=binary) for place, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {
            text(key, call, f"a key of {what}"): plain(item, call, f"{what}[{key!r}]", binary=binary)
            for key, item in value.items()
        }
    kind = type(value).__name__
    raise BadInput(
        f"{call}: {what} is {shortened(value)}, of type {kind}: give numbers, texts, or lists and mappings of them"
    )
