"""What travels on the wires between agents and a coupled world: samples one way, commands the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from . import payloads
from .agent import Sample


def pack_samples(samples: Iterable[Sample]) -> bytes:
    """Samples of one agent that were taken at one instant, bit for bit."""
    return payloads.encode(
        [(one.sensor, one.index, one.time_ns, *_flat(one.value)) for one in samples], precision="float64"
    )


def _flat(value: NDArray[np.float64] | None) -> tuple[Sequence[int] | None, NDArray[np.float64] | None]:
    return (None, None) if value is None else (value.shape, np.ravel(value))


def unpack_samples(payload: bytes) -> list[Sample]:
    """What `pack_samples` was given."""
    return [
        Sample(sensor, index, time_ns, None if shape is None else flat.reshape(shape))
        for sensor, index, time_ns, shape, flat in payloads.decode(payload)
    ]


def pack_command(command: str, value: NDArray[np.float64]) -> bytes:
    """A command and its value, bit for bit."""
    return payloads.encode((command, np.ravel(value)), precision="float64")


def unpack_command(payload: bytes) -> tuple[str, NDArray[np.float64]]:
    """What `pack_command` was given, the value flat."""
    command, value = payloads.decode(payload)
    return command, value
