"""Formation of point masses in relative coordinates: dynamics, process noise and measurement matrices.

Vehicles are numbered 0 … N−1, in the natural order of their names, and r_i = p_i − p_{i+1}, with i from 0 to N−2.
Public functions use the paper's order x = [r_0, v_0, r_1, v_1, …], shape (6(N−1),) [m, m/s]. The filters internally use
the *split* order, all positions before all velocities, [r_0, r_1, …, v_0, v_1, …]: the transition then acts on two
halves, and a pair is a sum over adjacent rows. The Joseph form keeps positions and velocities *about the first
vehicle*, [p_0 − p_0, p_1 − p_0, …, v_0 − v_0, …], shape (6N,): any pair is then the difference of two rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...units import check_above_zero
from ..checks import as_array

Pair = tuple[int, int]
"""(i, j): what is measured is p_i − p_j."""

NANOSECOND = 1e-9


@dataclass(frozen=True)
class Step:
    """Matrices of one step, in split order.

    model: the model of the formation.
    duration_s: its length [s].
    input_map: B, shape (6(N−1), 3N).
    process_noise: Q, shape (6(N−1), 6(N−1)), in Fortran order.
    """

    model: FormationModel
    duration_s: float
    input_map: NDArray[np.float64]
    process_noise: NDArray[np.float64]

    @cached_property
    def noise_root(self) -> NDArray[np.float64]:
        """G with G Gᵀ = Q, shape (6(N−1), 6N)."""
        return self.model.noise_root(self.duration_s)[self.model.split_order]

    @cached_property
    def input_about_first(self) -> NDArray[np.float64]:
        """B about the first vehicle, shape (6N, 3N)."""
        matrix: NDArray[np.float64] = about_first(self.model.vehicles) @ self.input_map
        return matrix

    @cached_property
    def noise_about_first(self) -> NDArray[np.float64]:
        """Q about the first vehicle, with a row and a column of zeros, shape (6N + 1, 6N + 1).

        The variance of each is 2 W, the covariance of two W; the first is certain of itself.
        """
        position, cross, velocity = self.model.noise_of(self.duration_s)
        shared = np.eye(self.model.vehicles) + 1.0
        shared[0] = shared[:, 0] = 0.0
        return np.pad(np.kron(np.kron([[position, cross], [cross, velocity]], shared), np.eye(3)), (0, 1))


@dataclass(frozen=True, eq=False)
class Rows:
    """Measurement matrix H of pairs of vehicles, k rows.

    vehicles: N.
    ends: for each row the entries about the first vehicle of which it is the difference, shape (2, k), read only.
    """

    vehicles: int
    ends: NDArray[np.intp]

    @cached_property
    def whole(self) -> NDArray[np.float64]:
        """H in split order, shape (k, 6(N−1)), read only."""
        first, second = about_first(self.vehicles).take(self.ends, axis=0)
        whole: NDArray[np.float64] = first - second
        whole.setflags(write=False)
        return whole


@dataclass(frozen=True)
class FormationModel:
    """N vehicles as point masses, moved by forces that are constant over a step and by unknown accelerations.

    r̈_i = F_i/m − F_{i+1}/m,  x⁺ = A x + B u            Nägeli 2014, (4)
    The unknown accelerations are white from step to step, equal in distribution on all axes and independent between
    vehicles. With W the variance due to one vehicle, r_i has the variance 2 W and the covariance −W with r_{i+1}, as
    both contain vehicle i+1: Q = D ⊗ W with D tridiagonal (−1, 2, −1).

    vehicles: N ≥ 2.
    step_ns: duration of an unknown acceleration, the step of the camera [ns].
    mass_kg: m, of each vehicle.
    acceleration_noise: standard deviation of the unknown acceleration per step, vehicle and axis [m/s²].
    """

    vehicles: int
    step_ns: int = 33_333_333
    mass_kg: float = 0.45
    acceleration_noise: float = 2.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.vehicles < 2:
            raise BadInput(f"a formation of {self.vehicles} has no relative positions: give 2 vehicles or more")
        check_above_zero("step_ns of a formation", self.step_ns)
        check_above_zero("mass_kg of a formation", self.mass_kg)
        check_above_zero("acceleration_noise", self.acceleration_noise, "m/s²")

    @property
    def size(self) -> int:
        """Length of the state, 6(N−1)."""
        return 6 * (self.vehicles - 1)

    @cached_property
    def split_order(self) -> NDArray[np.intp]:
        """Index in the paper's order of each entry of the split order: x_split = x[split_order]."""
        return np.arange(self.size).reshape(self.vehicles - 1, 2, 3).transpose(1, 0, 2).ravel()

    @cached_property
    def paper_order(self) -> NDArray[np.intp]:
        """Index in the split order of each entry of the paper's order: x = x_split[paper_order]."""
        return np.argsort(self.split_order)

    def reference(self, positions: ArrayLike) -> NDArray[np.float64]:
        """State of a formation at rest at these positions, shape (N, 3) [m].

        Raises:
            BadInput: wrong shape, or not finite.
        """
        places = as_array(positions, (self.vehicles, 3), "positions of a formation")
        relative = places[:-1] - places[1:]
        return np.hstack([relative, np.zeros_like(relative)]).ravel()

    def noise_of(self, duration_s: float) -> tuple[float, float, float]:
        """Variances (position, cross, velocity) [m², m²/s, m²/s²] on one axis of a vehicle after d steps.

        With σ the noise per step, h its length and d = duration/h, a real number:
        velocity σ²h² d, cross σ²h³ d²/2, position σ²h⁴ (d³/3 − d/12), which for integer d is exactly the sum over d
        steps; below one step, within which the unknown acceleration is constant, position σ²h⁴ d³/4.
        """
        step_s = self.step_ns * NANOSECOND
        steps = duration_s / step_s
        scale = (self.acceleration_noise * step_s) ** 2
        position = steps**3 / 4 if steps <= 1 else steps**3 / 3 - steps / 12
        return scale * step_s**2 * position, scale * step_s * steps**2 / 2, scale * steps

    @cached_property
    def _steps(self) -> Callable[[int], Step]:
        return lru_cache(maxsize=64)(partial(_step, self))

    @cached_property
    def pair(self) -> FormationModel:
        """The model of two of the vehicles, for messages on a pair."""
        return replace(self, vehicles=2)

    @cached_property
    def _standing(self) -> NDArray[np.float64]:
        return np.eye(self.size)

    @cached_property
    def _coupling(self) -> NDArray[np.float64]:
        coupling: NDArray[Any] = np.kron(np.eye(self.vehicles - 1), np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(3)))
        return coupling

    @cached_property
    def _noise_parts(self) -> tuple[NDArray[np.float64], ...]:
        shared = _incidence(self.vehicles) @ _incidence(self.vehicles).T
        parts = ([[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]])
        return tuple(np.kron(np.kron(shared, part), np.eye(3)) for part in parts)

    def step(self, duration_ns: int) -> Step:
        """Matrices of a step of this duration; cached, also between equal models."""
        return self._steps(duration_ns)

    def transition(self, duration_s: float) -> NDArray[np.float64]:
        """A of Nägeli 2014, Sec. II-B, dense, shape (6(N−1), 6(N−1)); the filters do not need it."""
        return self._standing + duration_s * self._coupling

    def input_map(self, duration_s: float) -> NDArray[np.float64]:
        """B of Nägeli 2014, Sec. II-B, dense, (6(N−1), 3N) [m/N, m/(N·s)]; its rows sum to zero over the vehicles."""
        per_force = np.array([[duration_s**2 / 2], [duration_s]]) / self.mass_kg
        return np.kron(np.kron(_incidence(self.vehicles), per_force), np.eye(3))

    def process_noise(self, duration_s: float) -> NDArray[np.float64]:
        """Q, dense, block tridiagonal, shape (6(N−1), 6(N−1)) [m², m²/s, m²/s²]."""
        position, cross, velocity = self.noise_of(duration_s)
        on_position, on_both, on_velocity = self._noise_parts
        return position * on_position + cross * on_both + velocity * on_velocity

    def noise_root(self, duration_s: float) -> NDArray[np.float64]:
        """G with G Gᵀ = Q: effect of each vehicle's two independent noises on the state, (6(N−1), 6N) [m, m/s]."""
        position, cross, velocity = self.noise_of(duration_s)
        deviation = velocity**0.5
        shared = cross / deviation if duration_s else 0.0
        own: list[list[float]] = [[shared, max(position - shared**2, 0.0) ** 0.5], [deviation, 0.0]]
        root: NDArray[Any] = np.kron(np.kron(_incidence(self.vehicles), np.array(own)), np.eye(3))
        return root

    def output_map(self, pairs: Sequence[Pair], *, velocities: bool = False) -> NDArray[np.float64]:
        """C, or H with velocities, of Nägeli 2014, Sec. II-B, dense, rows in the order of the pairs.

        Returns:
            Shape (3m, 6(N−1)), or (6m, 6(N−1)): position, then velocity, of each of the m pairs.
        Raises:
            BadInput: a pair of vehicles that do not exist, or of one with itself.
        """
        return rows(self.vehicles, tuple(pairs), velocities).whole[:, self.paper_order]


def check_pair(vehicles: int, pair: Pair) -> None:
    """Refuse a pair of vehicles that do not exist, or of one with itself.

    Raises:
        BadInput: the message gives the pair and the existing vehicles.
    """
    i, j = pair
    if not (0 <= i < vehicles and 0 <= j < vehicles) or i == j:
        raise BadInput(f"({i}, {j}) is no pair here: give two different vehicles of 0 … {vehicles - 1}")


@lru_cache(maxsize=1024)
def rows(vehicles: int, pairs: tuple[Pair, ...], velocities: bool) -> Rows:
    """C, or H with velocities, of m pairs, k = 3m or 6m.

    Raises:
        BadInput: a pair of vehicles that do not exist, or of one with itself.
    """
    for pair in pairs:
        check_pair(vehicles, pair)
    halves = 3 * vehicles * np.arange(2 if velocities else 1)
    entries = 3 * np.array(pairs, dtype=np.intp).T[:, :, None, None] + halves[:, None] + np.arange(3)
    ends: NDArray[np.intp] = entries.reshape(2, -1)
    ends.setflags(write=False)
    return Rows(vehicles, ends)


@lru_cache(maxsize=64)
def about_first(vehicles: int) -> NDArray[np.float64]:
    """Map from the split order to positions and velocities about the first vehicle, shape (6N, 6(N−1)), read only.

    p_i − p_0 = −(r_0 + … + r_{i−1})
    """
    sums = -np.tri(vehicles, vehicles - 1, -1)
    matrix: NDArray[Any] = np.kron(np.eye(2), np.kron(sums, np.eye(3)))
    matrix.setflags(write=False)
    return matrix


def _incidence(vehicles: int) -> NDArray[np.float64]:
    """Incidence matrix with rows e_i − e_{i+1}, shape (N−1, N)."""
    return np.eye(vehicles)[:-1] - np.eye(vehicles)[1:]


@lru_cache(maxsize=64)
def _step(model: FormationModel, duration_ns: int) -> Step:
    seconds, order = duration_ns * NANOSECOND, model.split_order
    noise = np.asfortranarray(model.process_noise(seconds)[np.ix_(order, order)])
    return Step(model, seconds, model.input_map(seconds)[order], noise)
