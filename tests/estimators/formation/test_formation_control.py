"""The regulator of a formation: rows that sum to zero, the step from A to B, and vehicles that are dead."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from volery.errors import BadInput
from volery.estimators.formation.control import Weights, control, regulator
from volery.estimators.formation.filter import LONGEST_STEP_NS
from volery.estimators.formation.model import FormationModel
from volery.randomness import stream

RATE = 30.0


def step_response(model: FormationModel, seconds: float) -> NDArray[np.float64]:
    """r_1x after its reference has moved, as a share of the step, at each step of the noise-free closed loop."""
    duration_s = model.step_ns * 1e-9
    A, B, gain = model.transition(duration_s), model.input_map(duration_s), regulator(model)
    state, reference, seen = np.zeros(model.size), np.zeros(model.size), []
    reference[0] = 0.45
    for _ in range(round(seconds * RATE)):
        seen.append(state[0] / 0.45)
        state = A @ state + B @ control(gain, state, reference).ravel()
    return np.array(seen)


def crossing(response: NDArray[np.float64], level: float) -> float:
    """When the response first reaches a level [s], between steps along a line."""
    after = int(np.argmax(response >= level))
    below, above = response[after - 1], response[after]
    return float(after - 1 + (level - below) / (above - below)) / RATE


def test_step_from_a_to_b_has_no_overshoot_and_rises_in_about_a_second() -> None:
    """Three vehicles, weights 4, 1 and 0.5: 10 to 90 % in 1.20 s; never above 1 but by rounding."""
    response = step_response(FormationModel(3), 8.0)
    rise = crossing(response, 0.9) - crossing(response, 0.1)
    assert rise == pytest.approx(1.2, abs=0.02)
    assert response.max() <= 1.0 + 1e-12
    assert response[-1] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("vehicles", [2, 3, 9, 30])
def test_a_common_estimate_never_pushes_the_centre_of_gravity(vehicles: int) -> None:
    """Σ_i K_i = 0 to rounding, so the forces of any state sum to zero; no single vehicle's row is zero."""
    gain = regulator(FormationModel(vehicles))
    sums = gain.reshape(vehicles, 3, -1).sum(axis=0)
    assert np.abs(sums).max() < 1e-13 * vehicles
    assert np.abs(gain).max(axis=1).min() > 0.1
    draws = stream(1, "test", "control")
    state = np.array([draws.normal(i) for i in range(6 * (vehicles - 1))])
    assert np.abs(control(gain, state, np.zeros_like(state)).sum(axis=0)).max() < 1e-12 * vehicles


def test_gain_of_one_axis_is_the_gain_of_all() -> None:
    """Solved dense for all three axes, with other weights; tolerance: that of the solver, about 1e-12."""
    model, weights = FormationModel(4, mass_kg=0.8), Weights(position=2.0, velocity=0.7, force=0.3)
    duration_s = model.step_ns * 1e-9
    A, B = model.transition(duration_s), model.input_map(duration_s)
    on_state, on_force = np.diag(np.tile(np.repeat([2.0, 0.7], 3), 3)), 0.3 * np.eye(12)
    X = solve_discrete_are(A, B, on_state, on_force)
    dense = np.linalg.solve(on_force + B.T @ X @ B, B.T @ X @ A)
    np.testing.assert_allclose(regulator(model, weights), dense, atol=1e-10)


def test_with_a_dead_vehicle_the_others_fly_as_a_formation_of_their_own() -> None:
    """Its row is zero, nobody reacts to where it is, and the living do what a formation of two does."""
    gain = regulator(FormationModel(3), dead=[1])
    assert not gain[3:6].any()
    assert np.abs(gain.reshape(3, 3, -1).sum(axis=0)).max() < 1e-14
    two = regulator(FormationModel(2))
    np.testing.assert_allclose(gain[0:3], np.hstack([two[0:3], two[0:3]]), rtol=1e-12)
    dead_moves = np.concatenate([-np.ones(6), np.ones(6)])
    assert np.abs(gain @ dead_moves).max() < 1e-14


@pytest.mark.parametrize("vehicles", [3, 9, 30])
def test_forces_may_be_held_as_long_as_the_longest_step(vehicles: int) -> None:
    """The loop that holds u over that long still settles, of any formation; held for a quarter longer, it does not."""
    model = FormationModel(vehicles)

    def radius(seconds: float) -> float:
        closed = model.transition(seconds) - model.input_map(seconds) @ regulator(model)
        return float(np.abs(np.linalg.eigvals(closed)).max())

    assert radius(LONGEST_STEP_NS * 1e-9) < 1.0
    assert radius(1.25 * LONGEST_STEP_NS * 1e-9) > 1.0


def test_bad_weights_references_and_vehicles_are_refused() -> None:
    """With what would do."""
    for name in ("position", "velocity", "force"):
        with pytest.raises(BadInput, match=f"weight of {name}"):
            Weights(**{name: 0.0})
    model = FormationModel(3)
    gain = regulator(model)
    with pytest.raises(BadInput, match=r"reference of shape \(6,\) .* for 3 vehicles: give \(12,\)"):
        control(gain, np.zeros(12), np.zeros(6))
    with pytest.raises(BadInput, match="not finite"):
        control(gain, np.full(12, np.nan), np.zeros(12))
    with pytest.raises(BadInput, match="dead vehicle 3"):
        regulator(model, dead=[3])
    with pytest.raises(BadInput, match="2 or more"):
        regulator(model, dead=[0, 2])
