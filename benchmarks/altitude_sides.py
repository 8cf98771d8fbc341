"""The two sides of `bench_altitude.py`: the same measurements through volery's filter and through filterpy's."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.estimators.altitude.components import GRAVITY, Barometer, Ground, Imu, RangeFinder, Robot
from volery.estimators.altitude.modular_filter import GROUND, GroundJumps, ModularFilter
from volery.estimators.altitude.replay import Stamped
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded

SCENARIO, SECONDS = "altitude-obstacles", 20
SENSORS = {"imu": Imu(), "baro": Barometer(), "laser": RangeFinder()}
Floats = NDArray[np.float64]


def flown() -> list[Stamped]:
    """The measurements of the scenario's sensors in the order of time."""
    plan = load_scenario(SCENARIO, [f"duration={SECONDS} s"]).plan
    taken = ((agent, sample) for (agent, _), batch in recorded(plan).batches.items() for sample in batch.samples)
    found = (Stamped(one.time_ns, agent, np.array(one.value)) for agent, one in taken if one.value is not None)
    return sorted(found, key=lambda measurement: measurement.key)


def volery_side(variant: str) -> dict[str, float]:
    """Microseconds a step, prediction and update, and the last altitude."""
    jumps = GroundJumps(variant)  # type: ignore[arg-type]
    of = ModularFilter(Robot(), Ground(), list(SENSORS.items()), jumps)
    belief, measurements = of.start(), flown()
    start = time.process_time()
    for each in measurements:
        belief = of.take(belief, each.time_ns, each.source, each.values)
    return _answer(start, len(measurements), belief.altitude)


def filterpy_side() -> dict[str, float]:
    """The same model in filterpy, with matrices made once and updated in place."""
    from filterpy.kalman import ExtendedKalmanFilter

    model = ModularFilter(Robot(), Ground(), list(SENSORS.items()), GroundJumps("as_printed"))
    start_belief = model.start()
    size = len(model.names)
    ekf = ExtendedKalmanFilter(size, 1)
    ekf.x, ekf.P = start_belief.mean.copy(), start_belief.covariance.copy()
    walks = np.square([0, 0, 1.0, 0, 0, 1.0, 1.0, Ground().walk, Imu().bias_walk, Barometer().bias_walk])
    sides = {"imu": _imu(size), "baro": _barometer(size), "laser": _range(size)}
    last_ns, measurements = 0, flown()
    start = time.process_time()
    for each in measurements:
        dt = (each.time_ns - last_ns) * 1e-9
        if dt > 0:
            ekf.F[0, 1] = ekf.F[1, 2] = ekf.F[3, 5] = ekf.F[4, 6] = dt
            ekf.F[0, 2] = dt * dt / 2
            ekf.F[GROUND, GROUND] = ekf.x[GROUND] > 0
            ekf.Q = np.diag(walks * dt)
            ekf.predict()
            last_ns = each.time_ns
        jacobian, expected, noise = sides[each.source]
        ekf.update(each.values, jacobian, expected, R=noise)
    return _answer(start, len(measurements), float(ekf.x[0]))


def _answer(start: float, steps: int, altitude: float) -> dict[str, float]:
    return {"us": (time.process_time() - start) / steps * 1e6, "altitude": altitude, "steps": float(steps)}


def _imu(size: int) -> Any:
    H = np.zeros((5, size))
    H[np.arange(5), [2, 3, 4, 5, 6]] = H[0, 8] = 1
    offset = np.array([GRAVITY, 0, 0, 0, 0])
    return (lambda _x: H), (lambda x: H @ x + offset), np.diag(Imu().variances())


def _barometer(size: int) -> Any:
    H = np.zeros((1, size))
    H[0, [0, 9]] = 1
    return (lambda _x: H), (lambda x: H @ x), np.diag(Barometer().variances())


def _range(size: int) -> Any:
    def expected(x: Floats) -> Floats:
        return np.array([(x[0] - x[GROUND]) / (math.cos(x[3]) * math.cos(x[4]))])

    def jacobian(x: Floats) -> Floats:
        upright = math.cos(x[3]) * math.cos(x[4])
        distance = (x[0] - x[GROUND]) / upright
        H = np.zeros((1, size))
        H[0, 0], H[0, GROUND] = 1 / upright, -1 / upright
        H[0, 3], H[0, 4] = distance * math.tan(x[3]), distance * math.tan(x[4])
        return H

    return jacobian, expected, np.diag(RangeFinder().variances())
