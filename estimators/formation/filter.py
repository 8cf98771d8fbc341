"""Kalman filter of a formation: predict with the known forces, update with all measured pairs of a step at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ..checks import as_array
from .covariance import checked_covariance
from .joseph import JosephBelief
from .model import FormationModel, Pair, Rows, Step, rows
from .square_root import SquareRootBelief

Form = Literal["joseph", "square-root", "compiled"]

LONGEST_STEP_NS = 250_000_000
"""Default bound of a step: with forces constant for more than 277 ms, the default regulator is unstable."""


_ALIKE = np.eye(3)


def steps_to(from_ns: int, to_ns: int) -> Iterator[int]:
    """Ends [ns] of steps from an instant to a later one, none longer than the default bound; none to an earlier one."""
    yield from range(from_ns + LONGEST_STEP_NS, to_ns, LONGEST_STEP_NS)
    if to_ns > from_ns:
        yield to_ns


@dataclass(frozen=True, slots=True)
class Observation:
    """Observed relative positions, or positions and velocities, of one or several pairs, with their covariance.

    pairs: m pairs (i, j); the values are p_i − p_j, and v_i − v_j.
    values: positions, shape (3m,) [m], or position and velocity of each pair, shape (6m,) [m, m/s].
    covariance: of the values, symmetric positive definite, shape (k, k); errors may be correlated within an
        observation, and are independent between observations.
    """

    pairs: tuple[Pair, ...]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Check shapes; the update checks the numbers."""
        size, least = len(self.values), 3 * len(self.pairs)
        if (size != least and size != 2 * least) or self.covariance.shape != (size, size):
            raise BadInput(
                f"{size} values with a covariance of shape {self.covariance.shape} for {len(self.pairs)} pairs: give 3 "
                f"values a pair, or 6 with velocities, and a row and a column of covariance for each"
            )

    @property
    def velocities(self) -> bool:
        """Whether the values include velocities."""
        return len(self.values) == 6 * len(self.pairs)


def sighting(first: int, second: int, position: ArrayLike, deviation: ArrayLike) -> Observation:
    """A camera's measurement of p_first − p_second.

    Args:
        first: the observer.
        second: the vehicle that it sees.
        position: in the inertial frame, shape (3,) [m].
        deviation: standard deviation, the same on all axes [m], or covariance, shape (3, 3) [m²].
    Raises:
        BadInput: wrong shape, not finite, or not positive.
    """
    place = np.array(position, dtype=np.float64)
    if place.shape != (3,):
        raise BadInput(f"position of a sighting has shape {place.shape}: give (3,)")
    if not isinstance(deviation, int | float):
        return Observation(((first, second),), place, checked_covariance(deviation, 3, "covariance of a sighting"))
    if not deviation > 0:
        raise BadInput(f"the deviation of a sighting is {deviation:g} m: give a number above 0")
    return Observation(((first, second),), place, _ALIKE * (deviation * deviation))


class FormationFilter:
    """Kalman filter of x̂ and P of a formation. With all cameras and the true forces it is the centralised filter.

    Args:
        model: the dynamics and their noise.
        state: initial x̂, shape (6(N−1),) [m, m/s], in the paper's order.
        covariance: initial P, shape (6(N−1), 6(N−1)), in the paper's order; or the two standard deviations of each
            relative position [m] and velocity [m/s].
        time_ns: initial instant [ns].
        form: representation and implementation of P; the results are equal up to rounding. `compiled` is the Joseph
            form compiled by Numba, from the extra volery[fast].
        longest_step_ns: bound of a step [ns].
    Raises:
        BadInput: wrong shape, not finite, or a covariance that is not positive definite; Numba is not installed.
    """

    def __init__(
        self,
        model: FormationModel,
        state: ArrayLike,
        covariance: ArrayLike = (1.0, 1.0),
        *,
        time_ns: int = 0,
        form: Form = "joseph",
        longest_step_ns: int = LONGEST_STEP_NS,
    ) -> None:
        self.model = model
        self.time_ns = time_ns
        self._longest_step_ns = longest_step_ns
        first = as_array(state, (model.size,), "state of a formation")[model.split_order]
        self.belief = _kind_of(form)(first, _initial(model, covariance))

    @property
    def state(self) -> NDArray[np.float64]:
        """x̂ in the paper's order, shape (6(N−1),) [m, m/s]."""
        return self.belief.state[self.model.paper_order]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """P in the paper's order, symmetric, shape (6(N−1), 6(N−1))."""
        order = self.model.paper_order
        return self.belief.covariance[np.ix_(order, order)]

    def pair(self, first: int, second: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Estimate of p_first − p_second and v_first − v_second, shape (6,) [m, m/s]; its covariance, (6, 6)."""
        seen = rows(self.model.vehicles, ((first, second),), True)
        return self.belief.seen(seen), self.belief.observed(seen)

    def predict(self, time_ns: int, forces: ArrayLike) -> None:
        """Predict to a later instant with forces that are constant until then.

        x̂⁺ = A x̂ + B u,  P⁺ = A P Aᵀ + Q            Nägeli 2014, Algorithm 1, lines 1 and 2

        Args:
            time_ns: the instant [ns], after the last one by at most the longest step.
            forces: u in the inertial frame, shape (N, 3) or (3N,) [N]; common forces such as weight are left out.
        Raises:
            BadInput: a step that is not above 0 or too long; forces of a wrong shape or not finite.
        """
        duration_ns = time_ns - self.time_ns
        if not 0 < duration_ns <= self._longest_step_ns:
            raise BadInput(
                f"a step of {duration_ns / 1e6:g} ms, from {self.time_ns} to {time_ns} ns: give more than 0 and "
                f"at most {self._longest_step_ns / 1e6:g} ms, in several steps if need be"
            )
        inputs = np.asarray(forces, dtype=np.float64).reshape(-1)
        if len(inputs) != 3 * self.model.vehicles:
            raise BadInput(f"forces {inputs.tolist()}: give 3 for each of {self.model.vehicles} vehicles")
        self.belief.predict(self.model.step(duration_ns), inputs)
        self.time_ns = time_ns

    def update(self, observations: Sequence[Observation]) -> None:
        """Update once with all observations of the present instant.

        x̂⁺ = x̂ + L (z − H x̂)            Nägeli 2014, (5) and Algorithm 1, lines 3 to 5
        The innovations of received messages, too, are relative to the own prediction. The errors of different
        observations are assumed to be independent.

        Raises:
            BadInput: a pair of vehicles that do not exist, values that are not finite, or a covariance that is not
                positive definite; nothing is changed then.
        """
        if not observations:
            return
        self.belief.update(*_stacked(self.model.vehicles, observations))


class Belief(Protocol):
    """Interface of the forms of P, in split order; documented in `joseph`."""

    def __init__(self, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None: ...

    @property
    def state(self) -> NDArray[np.float64]:
        """Estimate x̂."""

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance P."""

    def predict(self, step: Step, inputs: NDArray[np.float64]) -> None:
        """Predict by one step."""

    def update(self, rows: Rows, values: NDArray[np.float64], noise: NDArray[np.float64]) -> None:
        """Update with a measurement."""

    def seen(self, rows: Rows) -> NDArray[np.float64]:
        """H x̂."""

    def observed(self, rows: Rows) -> NDArray[np.float64]:
        """H P Hᵀ."""

    def inflate(self, factor: float) -> None:
        """Multiply P by a factor."""


def _kind_of(form: Form) -> type[Belief]:
    if form != "compiled":
        kinds: dict[str, type[Belief]] = {"joseph": JosephBelief, "square-root": SquareRootBelief}
        return kinds[form]
    try:
        from .compiled import CompiledBelief
    except ImportError as error:
        raise BadInput(f"form {form!r} needs Numba: pip install 'volery[fast]', or choose joseph ({error})") from error
    return CompiledBelief


def _initial(model: FormationModel, covariance: ArrayLike) -> NDArray[np.float64]:
    """Initial P, in split order."""
    given = np.asarray(covariance, dtype=np.float64)
    if given.shape == (2,):
        given = np.diag(np.tile(np.repeat(given * np.abs(given), 3), model.vehicles - 1))
    checked = checked_covariance(given, model.size, "covariance of a formation")
    return checked[np.ix_(model.split_order, model.split_order)]


def _stacked(
    vehicles: int, observations: Sequence[Observation]
) -> tuple[Rows, NDArray[np.float64], NDArray[np.float64]]:
    """H, values and block-diagonal noise of all observations together."""
    if len(observations) == 1:
        only = observations[0]
        return rows(vehicles, only.pairs, only.velocities), only.values, only.covariance
    ends = np.concatenate([rows(vehicles, each.pairs, each.velocities).ends for each in observations], axis=1)
    values = np.concatenate([each.values for each in observations])
    noise = np.zeros((len(values), len(values)))
    at = 0
    for each in observations:
        size = len(each.values)
        noise[at : at + size, at : at + size] = each.covariance
        at += size
    return Rows(vehicles, ends), values, noise
