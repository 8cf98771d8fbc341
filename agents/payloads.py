"""Payloads: what an agent puts into a frame, as MessagePack with floats in the precision that the scenario asks for.

Arrays come back as fresh, aligned, C-contiguous float64 copies, in every engine, so that the arithmetic on them has the
same bits everywhere.
"""

from __future__ import annotations

from reprlib import repr as shortened
from typing import Any, Literal

import msgpack
import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput, VoleryError

Precision = Literal["float64", "float32", "float16"]
DTYPES: dict[Precision, np.dtype[np.floating[Any]]] = {
    "float64": np.dtype("<f8"),
    "float32": np.dtype("<f4"),
    "float16": np.dtype("<f2"),
}
_TYPE_OF_SIZE = {dtype.itemsize: dtype for dtype in DTYPES.values()}
_ARRAY, _LIST, _NUMBER = 0, 16, 32
"""Codes of extensions, to which the bytes of one number are added."""


class DamagedPayload(VoleryError):
    """Bytes that are no payload."""


def encode(values: Any, precision: Precision = "float64") -> bytes:
    """MessagePack of plain values and one-dimensional arrays, every float in them in a precision.

    Numbers and truth values of NumPy are plain ones. An array, or a list of floats in less than float64, becomes an
    extension of its raw numbers.

    Raises:
        BadInput: something that is neither plain values nor a one-dimensional array.
    """
    dtype = DTYPES[precision]

    def extension(value: object) -> Any:
        if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "biuf":
            return msgpack.ExtType(_ARRAY + dtype.itemsize, value.astype(dtype, copy=False).tobytes())
        if isinstance(value, np.floating):
            return float(value) if precision == "float64" else reduced(float(value))
        if isinstance(value, np.integer | np.bool_):
            return value.item()
        kind = "more than 64 bits" if isinstance(value, int) else f"type {type(value).__name__}"
        raise BadInput(f"a payload holds plain values and one-dimensional arrays, not {shortened(value)} of {kind}")

    def reduced(value: Any) -> Any:
        """The value with its floats in less than float64."""
        if isinstance(value, float):
            return msgpack.ExtType(_NUMBER + dtype.itemsize, np.array([value], dtype).tobytes())
        if isinstance(value, list | tuple):
            if value and all(isinstance(item, float) for item in value):
                return msgpack.ExtType(_LIST + dtype.itemsize, np.array(value, dtype).tobytes())
            return [reduced(item) for item in value]
        return {key: reduced(item) for key, item in value.items()} if isinstance(value, dict) else value

    packed: bytes = msgpack.packb(values if precision == "float64" else reduced(values), default=extension)
    return packed


def decode(payload: bytes) -> Any:
    """What `encode` was given: tuples as lists, floats and arrays as float64 of what the precision holds.

    Raises:
        DamagedPayload: not such a payload.
    """
    try:
        return msgpack.unpackb(payload, ext_hook=_floats, strict_map_key=False)
    except (ValueError, KeyError, msgpack.UnpackException) as error:
        raise DamagedPayload(f"{len(payload)} bytes that are no payload: {error}") from error


def _floats(code: int, data: bytes) -> NDArray[np.float64] | list[float] | float:
    kind, size = divmod(code, _LIST)
    array = np.frombuffer(data, dtype=_TYPE_OF_SIZE[size]).astype(np.float64)
    if kind == _ARRAY:
        return array
    numbers: list[float] = array.tolist()
    if kind * _LIST == _LIST:
        return numbers
    (number,) = numbers
    return number
