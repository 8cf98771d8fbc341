"""Dynamic consensus on quaternions: each agent's average tracks its own estimate and those of its neighbours.

Letters: Q̄ an agent's average, Q̂ its own estimate, 𝒩 its neighbours, κ gain, A adjacency and D degree matrix, L = D − A
Laplacian. Q and −Q are the same attitude: a neighbour's quaternion is used with the sign nearer to the own average.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...rotations import normalised, same_sign
from ...topologies import natural_key
from ..checks import as_array

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AttitudeMessage:
    """A message to the neighbours: the sender's estimate Q̂ and its average Q̄, unit quaternions (4,)."""

    estimate: Floats
    average: Floats


def consensus_rate(own: AttitudeMessage, received: Mapping[str, AttitudeMessage]) -> Floats:
    """Rate of change of an agent's average [1/s], at gain 1.

    Σ_{l∈𝒩} (Q̄_l − Q̄_i) + Σ_{l∈𝒩} (Q̂_l − Q̄_i) + (Q̂_i − Q̄_i)            Betanzos 2024, (22) with a_ii = 1

    A neighbour without a message is left out of both sums.

    Args:
        own: estimate and average of this agent.
        received: neighbour → its message.
    Returns:
        Shape (4,).
    """
    average = own.average
    rate = same_sign(own.estimate, average) - average
    for name in sorted(received, key=natural_key):
        told = received[name]
        rate = rate + (same_sign(told.average, average) - average) + (same_sign(told.estimate, average) - average)
    return rate


def consensus_step(own: AttitudeMessage, received: Mapping[str, AttitudeMessage], step: float) -> Floats:
    """An agent's average after one step, normalised.

    Q̄⁺ = (Q̄ + κ dt · rate) / ‖·‖ with the rate of `consensus_rate`            Betanzos 2024, (22) by Euler's method

    Args:
        own: estimate and average of this agent.
        received: neighbour → its message.
        step: κ dt, above 0; the averages converge if it is below `largest_step` of the graph.
    Returns:
        Unit quaternion, (4,).
    Raises:
        BadInput: a step that is not above 0, or a result of norm 0.
    """
    if not step > 0.0:
        raise BadInput(f"step is {step:g}, it must be above 0")
    return normalised(own.average + step * consensus_rate(own, received))


def collective_matrices(adjacency: ArrayLike) -> tuple[Floats, Floats]:
    """The matrices Ξ and B of the dynamics of all averages, the same for each component of the quaternions.

    d/dt Q̄ = −(Ξ ⊗ I₄) Q̄ + (B ⊗ I₄) Q̂, Ξ = I + D + L, B = I + A            Betanzos 2024, (23)

    Args:
        adjacency: A, shape (n, n), symmetric, zeros and ones, zero diagonal.
    Returns:
        Ξ and B, shape (n, n) each. Their row sums are equal, so that equal estimates are an equilibrium.
    Raises:
        BadInput: not an adjacency matrix.
    """
    A = as_array(adjacency, (None, None), "adjacency")
    if A.shape[0] != A.shape[1] or (A != A.T).any() or A.diagonal().any() or not np.isin(A, (0.0, 1.0)).all():
        raise BadInput(f"adjacency {A.tolist()} must be symmetric, of zeros and ones, with a zero diagonal")
    degrees, identity = np.diag(A.sum(axis=1)), np.eye(len(A))
    return identity + 2.0 * degrees - A, identity + A


def largest_step(adjacency: ArrayLike) -> float:
    """The step κ dt below which the averages of a graph converge.

    2 / λ_max(Ξ): Euler's method is stable if |1 − κ dt λ| < 1 for every eigenvalue λ of Ξ, all of which are positive.

    Args:
        adjacency: as for `collective_matrices`.
    """
    rates, _ = collective_matrices(adjacency)
    return 2.0 / float(np.linalg.eigvalsh(rates)[-1])
