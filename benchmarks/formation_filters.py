"""The filter of a formation, FilterPy's and a dense one in NumPy, side by side on the same data, in batches in turn."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from volery.estimators.formation.filter import Form, FormationFilter, Observation
from volery.estimators.formation.model import FormationModel, Pair
from volery.randomness import stream

STEPS, BATCHES = 40, 60
STEP_NS = 33_333_333
CAMERA_NOISE, POSITION_NOISE, VELOCITY_NOISE = 0.02, 0.01, 0.05
AGREEMENT = 1e-9

Sample = dict[str, float]
Side = Callable[[int], None]


class _Data:
    """Forces, measurements and received messages of one vehicle in each step of a batch, the same in every batch."""

    def __init__(self, vehicles: int, heard: tuple[Pair, ...]) -> None:
        self.model = FormationModel(vehicles, STEP_NS)
        draws = stream(1, "benchmark", "formation")
        flat = iter(range(10**9))
        self.forces = np.array([[draws.normal(next(flat)) for _ in range(3 * vehicles)] for _ in range(STEPS)])
        self.seen = np.array([[draws.normal(next(flat)) for _ in range(3)] for _ in range(STEPS)])
        self.messages = np.array([[[draws.normal(next(flat)) for _ in range(6)] for _ in heard] for _ in range(STEPS)])
        self.heard = heard
        self.camera = np.eye(3) * CAMERA_NOISE**2
        self.message = np.diag(np.repeat([POSITION_NOISE**2, VELOCITY_NOISE**2], 3))

    @property
    def rows(self) -> NDArray[np.float64]:
        """C and H, dense."""
        seen = self.model.output_map([(0, 1)])
        return np.vstack([seen, self.model.output_map(self.heard, velocities=True)]) if self.heard else seen

    @property
    def noise(self) -> NDArray[np.float64]:
        """R and N, dense."""
        variances = np.tile(self.message.diagonal(), len(self.heard))
        return np.diag(np.concatenate([self.camera.diagonal(), variances]))


def twelve_states(heard: int, form: Form = "joseph") -> list[list[Sample]]:
    """Batches of volery and of FilterPy with three vehicles: a sighting, and so many messages, in every step."""
    data = _Data(3, ((1, 2), (2, 0))[:heard])
    own, theirs = _volery(data, form), _filterpy(data)
    return _in_turn([own[0], theirs[0]], lambda: np.abs(own[1]() - theirs[1]()).max())


def many_states(vehicles: int) -> list[list[Sample]]:
    """Batches of volery and of dense matrices in NumPy: a sighting in every step."""
    data = _Data(vehicles, ())
    own, dense = _volery(data), _dense(data)
    return _in_turn([own[0], dense[0]], lambda: np.abs(own[1]() - dense[1]()).max())


def two_sizes(fewer: int, more: int) -> list[list[Sample]]:
    """Batches of volery with fewer and with more vehicles: a sighting in every step."""
    return _in_turn([_volery(_Data(more, ()))[0], _volery(_Data(fewer, ()))[0]])


def _in_turn(sides: list[Side], apart: Callable[[], float] = float) -> list[list[Sample]]:
    """Processor time of a step of each side, batch by batch; `apart` is by how much their results differ in the end."""
    samples: list[list[Sample]] = [[] for _ in sides]
    with threadpool_limits(1):  # as in an agent's process
        for batch in range(BATCHES):
            for side, taken in zip(sides, samples, strict=True):
                began = time.process_time()
                side(batch)
                taken.append({"step_us": (time.process_time() - began) / STEPS * 1e6})
    if not apart() < AGREEMENT:
        raise RuntimeError(f"the two sides differ by {apart():g}")
    return samples


def _volery(data: _Data, form: Form = "joseph") -> tuple[Side, Callable[[], NDArray[np.float64]]]:
    own = FormationFilter(data.model, np.zeros(data.model.size), form=form)
    seen_pair, heard_pairs = ((0, 1),), [(pair,) for pair in data.heard]
    steps = [
        (forces, seen, list(zip(heard_pairs, received, strict=True)))
        for forces, seen, received in zip(data.forces, data.seen, data.messages, strict=True)
    ]

    def run(batch: int) -> None:
        time_ns = batch * STEPS * STEP_NS
        for forces, seen, received in steps:
            time_ns += STEP_NS
            own.predict(time_ns, forces)
            messages = [Observation(pair, values, data.message) for pair, values in received]
            own.update([Observation(seen_pair, seen, data.camera), *messages])

    return run, lambda: own.state


def _filterpy(data: _Data) -> tuple[Side, Callable[[], NDArray[np.float64]]]:
    seconds, rows = STEP_NS * 1e-9, data.rows
    theirs = KalmanFilter(dim_x=data.model.size, dim_z=len(rows), dim_u=3 * data.model.vehicles)
    theirs.F, theirs.B, theirs.Q = (
        matrix(seconds) for matrix in (data.model.transition, data.model.input_map, data.model.process_noise)
    )
    theirs.H, theirs.R = rows, data.noise
    columns = np.hstack([data.seen, data.messages.reshape(STEPS, -1)])[:, :, np.newaxis]
    steps = list(zip(data.forces[:, :, np.newaxis], columns, strict=True))

    def run(_: int) -> None:
        for forces, values in steps:
            theirs.predict(forces)
            theirs.update(values)

    return run, lambda: np.ravel(theirs.x)


def _dense(data: _Data) -> tuple[Side, Callable[[], NDArray[np.float64]]]:
    """As FilterPy does it, without what it keeps beside."""
    seconds, H, R = STEP_NS * 1e-9, data.rows, data.noise
    A, B, Q = data.model.transition(seconds), data.model.input_map(seconds), data.model.process_noise(seconds)
    held = {"x": np.zeros(data.model.size), "P": np.eye(data.model.size)}

    def run(_: int) -> None:
        x, P = held["x"], held["P"]
        for k in range(STEPS):
            x = A @ x + B @ data.forces[k]
            P = A @ P @ A.T + Q
            gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            x = x + gain @ (data.seen[k] - H @ x)
            rest = np.eye(len(x)) - gain @ H
            P = rest @ P @ rest.T + gain @ R @ gain.T
        held["x"], held["P"] = x, P

    return run, lambda: held["x"]


def step_us(samples: list[Sample]) -> float:
    """Median cost of a step [µs]."""
    return median(sample["step_us"] for sample in samples)
