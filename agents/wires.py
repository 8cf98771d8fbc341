"""Encoding of what travels on the wires between agents and a coupled world: samples one way, commands the other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import payloads
from .agent import Sample


def pack_samples(samples: Iterable[Sample]) -> bytes:
    """Encode samples of one agent that were taken at one instant, exactly."""
    return payloads.encode(
        [(one.sensor, one.index, one.time_ns, *_flat(one.value)) for one in samples], precision="float64"
    )


def _flat(value: NDArray[np.float64] | None) -> tuple[Sequence[int] | None, NDArray[np.float64] | None]:
    return (None, None) if value is None else (value.shape, value.ravel())


def unpack_samples(payload: bytes) -> list[Sample]:
    """Decode samples."""
    return [
        Sample(sensor, index, time_ns, None if shape is None else flat.reshape(shape))
        for sensor, index, time_ns, shape, flat in payloads.decode(payload)
    ]


def pack_commands(commands: Mapping[str, ArrayLike]) -> bytes:
    """Encode commands that are given at one instant, exactly."""
    flat = {name: np.asarray(value, dtype=np.float64).ravel() for name, value in commands.items()}
    return payloads.encode(flat, precision="float64")


def unpack_commands(payload: bytes) -> dict[str, NDArray[np.float64]]:
    """Decode commands, each value flat."""
    commands: dict[str, NDArray[np.float64]] = payloads.decode(payload)
    return commands
