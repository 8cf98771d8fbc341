"""What a sensor says, with the sensor faults in force: a pure function of the world, the faults and the index."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..randomness import stream
from ..transport.faults import Fault, SensorFault
from ..units import first_period, period_ns

if TYPE_CHECKING:
    from .plan import Plan


def measured(plan: Plan, faults: Iterable[Fault], agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
    """The sensor's index-th sample, None where it sees nothing.

    Faults in force when the sample is taken change it one after another, in the order in which they began: failed gives
    nothing, stuck the last sample before its start as the faults of then left it, bias z + b, noise z + b·n with
    n ~ N(0, I), spikes z ± b with the fault's probability.

    Raises:
        BadInput: a fault's size has another number of components than the sensor.
    """
    assert plan.world is not None
    rate = plan.world.sensors(agent)[sensor]
    ours = [
        fault for fault in faults if isinstance(fault, SensorFault) and (fault.agent, fault.sensor) == (agent, sensor)
    ]
    mine = [fault for fault in ours if fault.in_force(period_ns(rate, index))]
    mine.sort(key=lambda fault: (fault.at_ns, fault.id))
    if any(fault.trouble == "failed" for fault in mine):
        return None
    stuck = max((place for place, fault in enumerate(mine) if fault.trouble == "stuck"), default=None)
    if stuck is None:
        value = plan.world.measure(agent, sensor, index)
    else:
        last = first_period(rate, mine[stuck].at_ns) - 1
        value = measured(plan, ours, agent, sensor, last) if last >= 0 else None
        mine = mine[stuck + 1 :]
    if value is not None:
        for fault in mine:
            value = _disturbed(plan.seed, fault, value, index)
    return value


def _disturbed(seed: int, fault: SensorFault, value: NDArray[np.float64], index: int) -> NDArray[np.float64]:
    size: NDArray[np.float64] = np.asarray(fault.size, dtype=np.float64)
    if len(size) not in (1, value.size):
        raise BadInput(
            f"fault {fault.id}: size has {len(size)} components, sensor {fault.agent}.{fault.sensor} {value.size}"
        )
    if fault.trouble == "bias":
        return value + size
    draws = stream(seed, f"sensor-{fault.trouble}", fault.id, fault.agent, fault.sensor)
    if fault.trouble == "noise":
        normal = [draws.normal(index * value.size + component) for component in range(value.size)]
        value = value + size * np.array(normal).reshape(value.shape)
        return value
    sign = 1.0 if draws.uniform(2 * index) < 0.5 else -1.0
    return value + sign * size if draws.uniform(2 * index + 1) < fault.probability else value
