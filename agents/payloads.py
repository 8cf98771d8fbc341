"""Payloads: what an agent puts into a frame, as MessagePack with arrays in the precision that the scenario asks for.

Arrays come back as fresh, aligned, C-contiguous float64 copies, in every engine, so that the arithmetic on them has the
same bits everywhere.
"""

from __future__ import annotations

from typing import Any, Literal

import msgpack
import numpy as np
from numpy.typing import NDArray

from ..errors import VoleryError

Precision = Literal["float64", "float32", "float16"]
DTYPES: dict[Precision, np.dtype[np.floating[Any]]] = {
    "float64": np.dtype("<f8"),
    "float32": np.dtype("<f4"),
    "float16": np.dtype("<f2"),
}
_TYPE_OF_CODE = {dtype.itemsize: dtype for dtype in DTYPES.values()}


class DamagedPayload(VoleryError):
    """Bytes that are no payload."""


def encode(values: Any, precision: Precision = "float64") -> bytes:
    """MessagePack of plain values and one-dimensional arrays; an array becomes an extension of its raw numbers."""
    dtype = DTYPES[precision]

    def array(value: object) -> msgpack.ExtType:
        if not isinstance(value, np.ndarray) or value.ndim != 1:
            raise TypeError(f"a payload holds plain values and one-dimensional arrays, not {value!r}")
        return msgpack.ExtType(dtype.itemsize, value.astype(dtype, copy=False).tobytes())

    packed: bytes = msgpack.packb(values, default=array)
    return packed


def decode(payload: bytes) -> Any:
    """What `encode` was given, arrays as float64.

    Raises:
        DamagedPayload: not such a payload.
    """
    try:
        return msgpack.unpackb(payload, ext_hook=_array)
    except (ValueError, KeyError, msgpack.UnpackException) as error:
        raise DamagedPayload(f"{len(payload)} bytes that are no payload: {error}") from error


def _array(code: int, data: bytes) -> NDArray[np.float64]:
    return np.frombuffer(data, dtype=_TYPE_OF_CODE[code]).astype(np.float64)
