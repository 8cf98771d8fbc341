"""Formation control: a linear quadratic regulator of relative positions, with one gain for all vehicles."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...units import check_above_zero
from .model import NANOSECOND, FormationModel


@dataclass(frozen=True)
class Weights:
    """Weights of the regulator on positions [1/m²], velocities [s²/m²] and forces [1/N²], the same for all vehicles."""

    position: float = 4.0
    velocity: float = 1.0
    force: float = 0.5

    def __post_init__(self) -> None:
        """Check the signs."""
        for what, value in vars(self).items():
            check_above_zero(f"weight of {what}", value)


def regulator(model: FormationModel, weights: Weights | None = None, dead: Collection[int] = ()) -> NDArray[np.float64]:
    """Gain K of u = −K (x̂ − x_ref), from the discrete algebraic Riccati equation over one step of the model.

    X = AᵀXA − AᵀXB (W_u + BᵀXB)⁻¹ BᵀXA + W_x,  K = (W_u + BᵀXB)⁻¹ BᵀXA            Nägeli 2014, Sec. III-B
    A force that is common to all changes no relative position: B (1 ⊗ I₃) = 0. As W_u = w I is the same for all,
    (W_u + BᵀXB)(1 ⊗ I₃) = w (1 ⊗ I₃), hence (1 ⊗ I₃)ᵀK = w⁻¹ (B (1 ⊗ I₃))ᵀXA = 0: the vehicles' rows sum to zero, so
    that forces computed from a common estimate do not move the centre of gravity.

    Dead vehicles get rows of zeros. The others keep the formation of the living vehicles, with r from each to the next
    living one, so that no vehicle uses an estimate of a dead one.

    Args:
        model: dynamics and step.
        weights: 4, 1 and 0.5 by default.
        dead: dead vehicles.
    Returns:
        Shape (3N, 6(N−1)) [N/m, N·s/m], read only.
    Raises:
        BadInput: a dead vehicle does not exist, or fewer than two are alive.
    """
    unknown = sorted(set(dead) - set(range(model.vehicles)))
    if unknown:
        raise BadInput(f"dead vehicle {unknown[0]} does not exist: there are 0 … {model.vehicles - 1}")
    living = tuple(i for i in range(model.vehicles) if i not in dead)
    if len(living) < 2:
        raise BadInput(f"{len(living)} of {model.vehicles} vehicles alive: a formation needs 2 or more")
    return _regulator(model, weights or Weights(), living)


def control(gain: ArrayLike, state: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """Forces u = −K (x̂ − x_ref), shape (N, 3) [N], in the inertial frame, in addition to those against gravity.

    Args:
        gain: K, shape (3N, 6(N−1)).
        state: x̂, shape (6(N−1),).
        reference: x_ref, shape (6(N−1),).
    Raises:
        BadInput: a reference or a state of another length.
    """
    matrix = np.asarray(gain, dtype=np.float64)
    given, wanted = np.asarray(state, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    size = matrix.shape[1]
    if wanted.shape != (size,) or given.shape != (size,):
        raise BadInput(
            f"a reference of shape {wanted.shape} and a state of shape {given.shape} for {len(matrix) // 3} vehicles: "
            f"give ({size},), position and velocity of each relative to the next"
        )
    forces: NDArray[np.float64] = matrix.dot(wanted - given)
    if not math.isfinite(forces.dot(forces)):
        raise BadInput(f"a reference or a state is not finite: {wanted.tolist()}, {given.tolist()}")
    return forces.reshape(-1, 3)


@lru_cache(maxsize=16)
def _regulator(model: FormationModel, weights: Weights, living: tuple[int, ...]) -> NDArray[np.float64]:
    from scipy.linalg import solve, solve_discrete_are

    axis = FormationModel(len(living), model.step_ns, model.mass_kg, model.acceleration_noise)
    duration_s, one = model.step_ns * NANOSECOND, slice(None, None, 3)  # the axes are alike: solve one
    A, B = axis.transition(duration_s)[one, one], axis.input_map(duration_s)[one, one]
    on_state = np.tile([weights.position, weights.velocity], len(living) - 1)
    on_force = weights.force * np.eye(len(living))
    X = solve_discrete_are(A, B, np.diag(on_state), on_force)
    gain = solve(on_force + B.T @ X @ B, B.T @ X @ A, assume_a="pos")
    full = np.zeros((model.vehicles, 2 * (model.vehicles - 1)))
    full[list(living)] = gain @ _between(model.vehicles, living)
    result: NDArray[Any] = np.kron(full, np.eye(3))
    result.setflags(write=False)
    return result


def _between(vehicles: int, living: tuple[int, ...]) -> NDArray[np.float64]:
    """Matrix from the relative states of all vehicles to those of successive living ones, on one axis."""
    sums = np.zeros((len(living) - 1, vehicles - 1))
    for row, (i, j) in enumerate(pairwise(living)):
        sums[row, i:j] = 1.0
    spread: NDArray[Any] = np.kron(sums, np.eye(2))
    return spread
