"""Fastest-mixing weights by a convex program: an interior-point method with a bound of its error.

Boyd, Diaconis and Xiao 2004, "Fastest mixing Markov chain on a graph"; Xiao and Boyd 2004. Letters: W(w) = I − Σ_e w_e
b_e b_eᵀ with b_e = e_i − e_j for edge e = (i, j); J = 11ᵀ/N; s a bound on the essential spectral radius ρ(W − J).

    minimise s   subject to   −s I ≼ W(w) − J ≼ s I,   w_e ≥ 0,   Σ_{e at i} w_e ≤ 1

Newton's method minimises t·s plus the barrier −log det(s I − W + J) − log det(s I + W − J) − Σ log w − Σ log(1 − Σ w)
for growing t. At the minimum, s is within (2N + M + N) / t of the optimum, with M edges (Boyd and Vandenberghe 2004,
Sec. 11.2, 11.6).
"""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .graphs import agents, edges
from .spectra import contraction
from .weights import Weights, maximum_degree, weight_matrix

_GROWTH = 8.0
_NEWTON_DECREMENT = 1e-8
_NEWTON_STEPS = 60
_ARMIJO = 0.1


def fastest_mixing(graph: nx.Graph, tolerance: float = 1e-6) -> Weights:
    """Symmetric nonnegative weights with the smallest essential spectral radius; format as in `metropolis`.

    The radius is within `tolerance` of the optimum.

    Raises:
        BadInput: a graph that is not connected, or a tolerance that is not above 0.
    """
    if not nx.is_connected(graph):
        raise BadInput("no weights mix on a graph that is not connected")
    if not tolerance > 0:
        raise BadInput(f"tolerance is {tolerance:g}, it must be above 0")
    names, pairs = agents(graph), edges(graph)
    program = _Program(np.array([[float(name == i) - float(name == j) for i, j in pairs] for name in names]))
    weights = program.solve(program.start(graph), tolerance)
    found: Weights = {name: {} for name in names}
    for (first, second), weight in zip(pairs, weights.tolist(), strict=True):
        found[first][second] = found[second][first] = weight
    return {name: {**counted, name: 1.0 - sum(counted.values())} for name, counted in found.items()}


@dataclass(frozen=True)
class _Program:
    """The convex program of one graph. A point is (w, s), shape (M + 1,); `incidence` (N, M) has the columns b_e."""

    incidence: NDArray[np.float64]

    @property
    def count(self) -> int:
        """Number of agents N."""
        return len(self.incidence)

    def start(self, graph: nx.Graph) -> NDArray[np.float64]:
        """A strictly feasible point: maximum-degree weights leave positive own weights, and s is above their radius."""
        counted = maximum_degree(graph)
        weight = next(value for name, row in counted.items() for other, value in row.items() if other != name)
        radius = contraction(weight_matrix(graph, counted))
        return np.append(np.full(self.incidence.shape[1], weight), radius + 0.1)

    def solve(self, point: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
        """Weights w (M,) whose radius is within the tolerance of the optimum."""
        constraints = sum(self.incidence.shape) + 2 * self.count
        t = 1.0
        while True:
            point = self._centre(point, t)
            if constraints / t <= tolerance:
                return point[:-1]
            t *= _GROWTH

    def _centre(self, point: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        for _ in range(_NEWTON_STEPS):
            gradient, hessian = self._derivatives(point, t)
            step = -np.linalg.solve(hessian, gradient)
            decrement = float(-gradient @ step)
            if decrement <= _NEWTON_DECREMENT:
                break
            here, length = self._barrier(point, t), 1.0
            while self._barrier(point + length * step, t) > here - _ARMIJO * length * decrement:
                length /= 2
                if length < 1e-12:  # at the floor of rounding: this is the minimum
                    return point
            point = point + length * step
        return point

    def _sides(self, point: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The matrices s I − (W − J) and s I + (W − J)."""
        w, s = point[:-1], point[-1]
        identity = np.eye(self.count)
        matrix = identity - (self.incidence * w) @ self.incidence.T - 1.0 / self.count
        return s * identity - matrix, s * identity + matrix

    def _left(self, w: NDArray[np.float64]) -> NDArray[np.float64]:
        """Own weights of the agents (N,): 1 − Σ w."""
        left: NDArray[np.float64] = 1.0 - np.abs(self.incidence) @ w
        return left

    def _barrier(self, point: NDArray[np.float64], t: float) -> float:
        w, left = point[:-1], self._left(point[:-1])
        if min(w.min(), left.min()) <= 0:
            return np.inf
        total = t * point[-1] - np.log(w).sum() - np.log(left).sum()
        for side in self._sides(point):
            try:
                total -= 2 * np.log(np.diag(np.linalg.cholesky(side))).sum()
            except np.linalg.LinAlgError:
                return np.inf
        return float(total)

    def _derivatives(self, point: NDArray[np.float64], t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Gradient (M + 1,) and Hessian. Of −log det X: −tr(X⁻¹ dX), tr(X⁻¹ dX X⁻¹ dX), with dX = ±b bᵀ or I."""
        w, left = point[:-1], self._left(point[:-1])
        size = len(w)
        gradient = np.append(-1.0 / w, t)
        hessian = np.zeros((size + 1, size + 1))
        hessian[np.arange(size), np.arange(size)] = 1.0 / w**2
        B, touch = self.incidence, np.abs(self.incidence)
        gradient[:-1] += touch.T @ (1.0 / left)
        hessian[:-1, :-1] += touch.T @ (touch / left[:, np.newaxis] ** 2)
        for sign, side in zip((1.0, -1.0), self._sides(point), strict=True):
            inverse = np.linalg.solve(side, np.eye(self.count))
            spread = inverse @ B
            gradient[:-1] -= sign * (B * spread).sum(axis=0)
            gradient[-1] -= np.trace(inverse)
            hessian[:-1, :-1] += (B.T @ spread) ** 2
            across = sign * (spread**2).sum(axis=0)
            hessian[:-1, -1] += across
            hessian[-1, :-1] += across
            hessian[-1, -1] += (inverse**2).sum()
        return gradient, hessian
