"""One step of a measurement unit of Betanzos 2024, and of filters of ahrs, on the same directions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from volery.estimators.attitude.directions import learned_quaternion
from volery.estimators.attitude.dynamic_consensus import AttitudeMessage, consensus_step
from volery.randomness import stream
from volery.rotations import angle_between, conjugate, euler_to_quaternion, integrate, quaternion_product, rotate
from volery.worlds.rigid_body.measurement_units import DIRECTIONS

Floats = NDArray[np.float64]

STEPS = 2000
RATE_HZ = 10.0
NOISE = 0.02
TURNING = np.radians([0.2, -0.1, 0.8])
REFERENCES = [np.array(direction) for direction in DIRECTIONS.values()]
START = euler_to_quaternion(0.5, 0.3, 0.0)
_DIP_DEG = math.degrees(math.atan2(0.348, 0.337))


def flight() -> tuple[list[Floats], list[list[Floats]]]:
    """Attitudes of the body, and the two noisy directions that a unit aligned with it sees in each."""
    draws, q, attitudes, seen = stream(1, "benchmark"), START, [], []
    for step in range(STEPS):
        attitudes.append(q)
        both = []
        for sensor, reference in enumerate(REFERENCES):
            noise = [NOISE * draws.normal(6 * step + 3 * sensor + axis) for axis in range(3)]
            direction = rotate(conjugate(q), reference) + noise
            both.append(direction / np.linalg.norm(direction))
        seen.append(both)
        q = integrate(q, TURNING, 1 / RATE_HZ)
    return attitudes, seen


def timed(step: Callable[[Sequence[Floats]], Floats]) -> dict[str, float]:
    """Microseconds of a step, and the root mean square error in degrees after the first tenth."""
    attitudes, seen = flight()
    begin = time.perf_counter()
    found = [step(both) for both in seen]
    step_us = 1e6 * (time.perf_counter() - begin) / STEPS
    pairs = list(zip(attitudes, found, strict=True))[STEPS // 10 :]
    squares = [angle_between(true, np.asarray(mine)) ** 2 for true, mine in pairs]
    return {"step_us": step_us, "error_deg": math.degrees(math.sqrt(float(np.mean(squares))))}


def volery() -> dict[str, float]:
    """LQS with a mounting, and a step of dynamic consensus with two neighbours of equal state."""
    mounting = euler_to_quaternion(math.radians(135), 0.0, 0.0)
    turned_back = conjugate(mounting)
    own = AttitudeMessage(START, START)

    def step(both: Sequence[Floats]) -> Floats:
        nonlocal own
        average = consensus_step(own, {"2": own, "3": own}, 0.2)
        frame = quaternion_product(average, mounting)
        learned = learned_quaternion(frame, [rotate(turned_back, each) for each in both], REFERENCES)
        own = AttitudeMessage(quaternion_product(learned, turned_back), average)
        return average

    return timed(step)


def roleq() -> dict[str, float]:
    """The recursive filter of ahrs, with the true rates of turning as those of its gyroscope."""
    from ahrs.filters import ROLEQ

    made, q = ROLEQ(frequency=RATE_HZ, magnetic_ref=REFERENCES[1], frame="NED"), START

    def step(both: Sequence[Floats]) -> Floats:
        nonlocal q
        q = np.asarray(made.update(q, TURNING, -both[0], both[1]))
        return q

    return timed(step)


def davenport() -> dict[str, float]:
    """The least squares of ahrs over the two directions of one sample."""
    from ahrs.filters import Davenport

    made = Davenport(magnetic_dip=_DIP_DEG)
    return timed(lambda both: np.asarray(made.estimate(acc=both[0], mag=both[1])))
