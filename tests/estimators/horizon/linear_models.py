"""A linear model with an error state that is the state's difference, for what must hold to rounding."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from volery.estimators.horizon.error_state import Noise

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LinearModel:
    """x⁺ = F x + G (u + w), y = H x + noise; lightly damped, N = 4, U = M = 2, R = 3."""

    noise: Noise
    F: Floats
    G: Floats
    H: Floats
    resting: Floats = field(default_factory=lambda: np.zeros(2))

    def dynamics(self, states: Floats, inputs: Floats, disturbances: Floats) -> tuple[Floats, Floats, Floats]:
        """The same matrices everywhere."""
        n = len(states)
        following = states @ self.F.T + (inputs + disturbances) @ self.G.T
        return following, np.tile(self.F, (n, 1, 1)), np.tile(self.G, (n, 1, 1))

    def outputs(self, states: Floats, inputs: Floats) -> tuple[Floats, Floats]:
        """The same row everywhere."""
        return states @ self.H.T, np.tile(self.H, (len(states), 1, 1))

    def retract(self, states: Floats, errors: Floats) -> Floats:
        """A sum."""
        return states + errors

    def difference(self, states: Floats, references: Floats) -> Floats:
        """A difference."""
        return states - references

    def components(self, states: Floats) -> Floats:
        """The state itself."""
        return states


def linear_model(bound: float = np.inf, upper: float = np.inf) -> LinearModel:
    """One model, with a bound of |w| and one from above on the last component of the state."""
    rng = np.random.default_rng(5)
    F = np.linalg.qr(rng.normal(size=(4, 4)))[0] * 0.97
    noise = Noise(
        disturbances=np.array([0.3, 0.2]),
        gaps=np.array([1.0, 1.0]),
        bounds=np.full(2, bound),
        measurements=np.array([0.1, 0.2, 0.3]),
        lower=np.full(4, -np.inf),
        upper=np.array([np.inf, np.inf, np.inf, upper]),
    )
    return LinearModel(noise, F, rng.normal(size=(4, 2)), rng.normal(size=(3, 4)))


def simulated(model: LinearModel, points: int, seed: int = 8) -> tuple[Floats, Floats, Floats]:
    """States (K, 4), measured inputs (K, 2) and measured values (K, 3) of a run."""
    rng = np.random.default_rng(seed)
    states, inputs = np.zeros((points, 4)), rng.normal(size=(points, 2))
    steps = 0.5 * (inputs[1:] + inputs[:-1])
    for k in range(points - 1):
        disturbance = rng.normal(size=2) * model.noise.disturbances
        states[k + 1] = model.dynamics(states[k : k + 1], steps[k : k + 1], disturbance[np.newaxis])[0][0]
    return states, inputs, states @ model.H.T + rng.normal(size=(points, 3)) * model.noise.measurements
