"""Consensus on SO(3): agents that measure each other's relative orientation agree on one inertial frame.

Letters: q_i attitude of agent i in its own frame, ξ orientation of i relative to j as measured by j, body i → body j;
γ_ij = q_j ⊙ ξ attitude of i by j, a_ij ≥ 0 its weight at i, ε the step.  Nägeli 2014, Algorithm 2.
All rotations are unit quaternions (4,) in the convention of `rotations`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...rotations import (
    angle_between,
    conjugate,
    exp_quaternion,
    log_quaternion,
    mean_quaternion,
    normalised,
    quaternion_product,
)
from ..checks import check_neighbour

Floats = NDArray[np.float64]

_ZERO = 1e-9


def seen_attitude(attitude: Floats, relative: Floats) -> Floats:
    """Attitude of a neighbour, as determined by an agent that sees it, (4,): Γ = R ξ.

    Nägeli 2014, Algorithm 2, line 9, with the factors in the order that the frames require

    Args:
        attitude: of the observing agent, its body → its inertial frame, (4,).
        relative: ξ, body of the neighbour → body of the observing agent, (4,).
    """
    return quaternion_product(attitude, relative)


def consensus_step(attitude: Floats, heard: Mapping[str, Floats], weights: Mapping[str, float], step: float) -> Floats:
    """The attitude (4,) after one step towards the attitudes Γ_ij determined by the neighbours.

    R⁺ = R exp(ε Σ_j a_ij log(Rᵀ Γ_ij))            Nägeli 2014, Algorithm 2, line 8; Tron, Vidal and Terzis 2008

    Neighbours without a message are left out.

    Args:
        attitude: R_i, (4,).
        heard: neighbour j → Γ_ij, (4,).
        weights: neighbour → a_ij, dimensionless, ≥ 0.
        step: ε, dimensionless; see `check_step`.
    Raises:
        BadInput: a sender without a weight.
    """
    pull = np.zeros(3)
    for name, said in heard.items():
        check_neighbour(name, weights)
        pull += weights[name] * log_quaternion(quaternion_product(conjugate(attitude), said))
    return normalised(quaternion_product(attitude, exp_quaternion(step * pull)))


def step_bound(weights: Mapping[str, Mapping[str, float]], anchor: float = 0.0) -> float:
    """Upper bound of the step ε for convergence of consensus, for attitudes that are near each other.

    In x⁺ = ((1 − κ) 1 − ε L) x every mode except the common one must decay, |1 − κ − ε λ| < 1. For symmetric weights
    this is ε < (2 − κ) / λ_max, and 2 / λ_max without anchor κ; L is the Laplacian of the weights.

    Args:
        weights: agent → neighbour → a_ij ≥ 0, 0 for agents that are not named; need not be symmetric.
        anchor: κ, see `FrameConsensus`, in [0, 1).
    Raises:
        BadInput: a negative weight, a weight for the agent itself or an unknown agent, no positive weight at all, or an
            anchor out of bounds.
    """
    check_anchor(anchor)
    places = {name: place for place, name in enumerate(weights)}
    laplacian = np.zeros((len(places), len(places)))
    for name, counted in weights.items():
        for other, weight in counted.items():
            if other == name or other not in places or not weight >= 0.0:
                raise BadInput(f"weight {weight:g} of {other} at {name}: give weights ≥ 0 for other agents here")
            laplacian[places[name], places[other]] -= weight
            laplacian[places[name], places[name]] += weight
    modes = np.linalg.eigvals(laplacian)
    modes = modes[np.abs(modes) > _ZERO * max(1.0, float(np.abs(laplacian).max(initial=0.0)))]
    if not len(modes):
        raise BadInput("nobody hears anybody with a positive weight: there is no consensus, and no bound on its step")
    size, real = np.abs(modes) ** 2, (1.0 - anchor) * modes.real
    return float(((real + np.sqrt(real**2 + size * (1.0 - (1.0 - anchor) ** 2))) / size).min())


def check_step(step: float, weights: Mapping[str, Mapping[str, float]], anchor: float = 0.0) -> None:
    """Refuse a step with which consensus on this graph does not converge.

    Raises:
        BadInput: it is not above 0 and below `step_bound`; the message gives the bound.
    """
    bound = step_bound(weights, anchor)
    if not 0.0 < step < bound * (1.0 - _ZERO):
        raise BadInput(f"step is {step:g}: must be above 0 and below {bound:.6g}, the bound of these weights")


def check_anchor(anchor: float) -> None:
    """Refuse an anchor that is not in [0, 1).

    Raises:
        BadInput: it is not.
    """
    if not 0.0 <= anchor < 1.0:
        raise BadInput(f"anchor is {anchor:g}: must be at least 0, no pull to the own frame, and below 1, nothing else")


def disagreement(attitudes: Floats) -> float:
    """Root mean square angle [rad] between N attitudes or frames, (N, 4), and their mean."""
    mean = mean_quaternion(attitudes)
    return float(np.sqrt(np.mean([angle_between(mean, each) ** 2 for each in attitudes])))
