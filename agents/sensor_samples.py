"""Samples of sensors with the sensor faults in force: pure functions of the world, the faults and the index."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..randomness import stream
from ..transport.faults import Fault, SensorFault
from ..units import first_sample, sample_ns
from .plan import Plan

_STRIDE_OF_ROWS = 2**16
"""Between the draws for samples whose number of rows varies."""


def numbers(sample: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a sample that faults change: all, but of rows (n, k) not the first column, which identifies them."""
    return sample if sample.ndim == 1 else sample[:, 1:]


def measured(plan: Plan, faults: Iterable[Fault], agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
    """The sensor's index-th sample, None where it sees nothing.

    Faults in force when the sample is taken change it one after another, in the order in which they began: failed gives
    nothing, stuck the last sample before its start as the faults of then left it, bias z + b, noise z + b·n with
    n ~ N(0, I), spikes z ± b with the fault's probability.

    Raises:
        BadInput: a fault's size has another number of components than the sensor.
    """
    assert plan.world is not None
    times = plan.world.sensors(agent)[sensor]
    taken_ns = sample_ns(times, index)
    if taken_ns is None:
        return None
    ours = [
        fault for fault in faults if isinstance(fault, SensorFault) and (fault.agent, fault.sensor) == (agent, sensor)
    ]
    mine = [fault for fault in ours if fault.in_force(taken_ns)]
    mine.sort(key=lambda fault: (fault.at_ns, fault.id))
    if any(fault.trouble == "failed" for fault in mine):
        return None
    stuck = max((place for place, fault in enumerate(mine) if fault.trouble == "stuck"), default=None)
    if stuck is None:
        value = plan.world.measure(agent, sensor, index)
    else:
        last = first_sample(times, mine[stuck].at_ns) - 1
        value = measured(plan, ours, agent, sensor, last) if last >= 0 else None
        mine = mine[stuck + 1 :]
    if value is not None:
        for fault in mine:
            value = _disturbed(plan.seed, fault, value, index)
    return value


class Disturbances:
    """The same for a coupled world, whose samples are taken once and in the order of their times."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._last: dict[tuple[str, str], NDArray[np.float64] | None] = {}
        self._stuck: dict[tuple[str, str, str], NDArray[np.float64] | None] = {}

    def disturbed(
        self,
        faults: Iterable[Fault],
        agent: str,
        sensor: str,
        index: int,
        time_ns: int,
        value: NDArray[np.float64] | None,
    ) -> NDArray[np.float64] | None:
        """The index-th sample as the faults leave it; see `measured`.

        Raises:
            BadInput: a fault's size has another number of components than the sensor.
        """
        mine = [
            fault
            for fault in faults
            if isinstance(fault, SensorFault)
            and (fault.agent, fault.sensor) == (agent, sensor)
            and fault.in_force(time_ns)
        ]
        failed = False
        for fault in sorted(mine, key=lambda fault: (fault.at_ns, fault.id)):
            if fault.trouble == "stuck":
                value = self._stuck.setdefault((fault.id, agent, sensor), self._last.get((agent, sensor)))
            elif fault.trouble == "failed":
                failed = True
            elif value is not None:
                value = _disturbed(self._seed, fault, value, index)
        value = None if failed else value
        self._last[agent, sensor] = value
        return value


def _disturbed(seed: int, fault: SensorFault, value: NDArray[np.float64], index: int) -> NDArray[np.float64]:
    disturbed = np.array(value, dtype=np.float64)
    mine, size = numbers(disturbed), np.asarray(fault.size, dtype=np.float64)
    if len(size) not in (1, mine.shape[-1]):
        raise BadInput(
            f"fault {fault.id}: size has {len(size)} components, sensor {fault.agent}.{fault.sensor} {mine.shape[-1]}"
        )
    if fault.trouble == "bias":
        mine += size
        return disturbed
    draws = stream(seed, f"sensor-{fault.trouble}", fault.id, fault.agent, fault.sensor)
    if fault.trouble == "noise":
        stride = mine.size if mine.ndim == 1 else _STRIDE_OF_ROWS
        normal = [draws.normal(index * stride + component) for component in range(mine.size)]
        mine += size * np.array(normal).reshape(mine.shape)
    elif draws.uniform(2 * index + 1) < fault.probability:
        mine += size if draws.uniform(2 * index) < 0.5 else -size
    return disturbed
