"""The formation model and its filter, against the dense textbook form."""

import sys
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from volery.errors import BadInput
from volery.estimators import error_measures as metrics
from volery.estimators.formation.filter import Form, FormationFilter, Observation, sighting
from volery.estimators.formation.model import FormationModel, Pair
from volery.randomness import stream

STEP_NS = 33_333_333
STEP_S = STEP_NS * 1e-9
FORMS: tuple[Form, ...] = get_args(Form)


@pytest.fixture(autouse=True)
def _with_numba(request: pytest.FixtureRequest) -> None:
    """The compiled form is tried where it can be had."""
    if "form" in request.fixturenames and request.getfixturevalue("form") == "compiled":
        pytest.importorskip("numba")


def normals(seed: int, *shape: int) -> NDArray[np.float64]:
    """Standard normal draws."""
    draws = stream(seed, "test", "formation")
    return np.array([draws.normal(i) for i in range(int(np.prod(shape)))]).reshape(shape)


def covariance_of(size: int, seed: int) -> NDArray[np.float64]:
    """A positive definite matrix."""
    root = normals(seed, size, size)
    product: NDArray[np.float64] = root @ root.T + np.eye(size)
    return product


class Textbook:
    """Kalman filter with dense matrices and the optimal gain, as in any textbook."""

    def __init__(self, model: FormationModel, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        self.model, self.x, self.P = model, state.copy(), covariance.copy()

    def predict(self, duration_s: float, forces: NDArray[np.float64]) -> None:
        """x⁺ = A x + B u, P⁺ = A P Aᵀ + Q."""
        A, B = self.model.transition(duration_s), self.model.input_map(duration_s)
        self.x = A @ self.x + B @ forces
        self.P = A @ self.P @ A.T + self.model.process_noise(duration_s)

    def update(self, H: NDArray[np.float64], z: NDArray[np.float64], R: NDArray[np.float64]) -> None:
        """K = P Hᵀ (H P Hᵀ + R)⁻¹."""
        gain = np.linalg.solve(H @ self.P @ H.T + R, H @ self.P).T
        self.x = self.x + gain @ (z - H @ self.x)
        rest = np.eye(len(self.x)) - gain @ H
        self.P = rest @ self.P @ rest.T + gain @ R @ gain.T


def moved(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """The state of vehicles with these positions and velocities, shape (N, 6)."""
    return (positions[:-1] - positions[1:]).ravel()


def test_model_is_the_difference_of_point_masses_under_held_forces() -> None:
    """r_i = p_i − p_{i+1} of four vehicles that each obey p̈ = F/m, by the matrix exponential; tolerance: rounding."""
    model = FormationModel(4, mass_kg=0.7)
    vehicles, forces = normals(1, 4, 6), normals(2, 4, 3)
    held = expm(np.kron([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]], np.eye(3)) * 0.3)
    after = np.array(
        [(held @ np.concatenate([own, force / 0.7]))[:6] for own, force in zip(vehicles, forces, strict=True)]
    )
    found = model.transition(0.3) @ moved(vehicles) + model.input_map(0.3) @ forces.ravel()
    np.testing.assert_allclose(found, moved(after), rtol=0, atol=1e-14)
    np.testing.assert_array_equal(model.reference(vehicles[:, :3])[0:3], vehicles[0, :3] - vehicles[1, :3])


def test_noise_is_that_of_unknown_accelerations_held_over_steps() -> None:
    """Of N vehicles, each pushed by independent ones: neighbours r_i, r_{i+1} share a vehicle, r_i and r_{i+2} none.

    Over whole steps it is the sum over the steps; over a part of a step the acceleration is one and the same.
    """
    model = FormationModel(5, step_ns=50_000_000, acceleration_noise=1.5)
    push = np.kron(np.eye(5), np.kron(np.array([[0.05**2 / 2], [0.05]]), np.eye(3))) * 1.5
    difference = np.kron(np.eye(5)[:-1] - np.eye(5)[1:], np.eye(6))
    one = difference @ push @ push.T @ difference.T
    np.testing.assert_allclose(model.process_noise(0.05), one, rtol=0, atol=1e-15)
    assert not one[:6, 12:18].any()
    assert one[:6, 6:12].any()
    A, many = model.transition(0.05), np.zeros_like(one)
    for _ in range(7):
        many = A @ many @ A.T + one
    np.testing.assert_allclose(model.process_noise(0.35), many, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(
        model.noise_of(0.02), np.array([0.02**4 / 4, 0.02**3 / 2, 0.02**2]) * 1.5**2 * 0.05 / 0.02
    )


def test_steps_of_any_duration_add_up() -> None:
    """Prediction over 2 + 1 + 3 steps is prediction over 6, forces held; tolerance: rounding."""
    model = FormationModel(3)
    forces = normals(3, 3, 3)
    one, parts = (FormationFilter(model, normals(4, 12), (0.3, 0.4)) for _ in range(2))
    one.predict(6 * STEP_NS, forces)
    for steps in (2, 3, 6):
        parts.predict(steps * STEP_NS, forces)
    np.testing.assert_allclose(parts.state, one.state, rtol=1e-13)
    np.testing.assert_allclose(parts.covariance, one.covariance, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("vehicles", [2, 3, 6])
def test_filter_by_blocks_is_the_textbook_one(vehicles: int, form: Form) -> None:
    """Any pairs, both ways round and over several links of the chain, with and without velocities, several at once.

    Tolerance: entries are of order 1 and 30 steps each lose some 10 units in the last place; 1e-10 has room for the
    condition of the covariances, about 10⁴.
    """
    model = FormationModel(vehicles)
    pairs = [(i, j) for i in range(vehicles) for j in range(vehicles) if i != j]
    start, spread = normals(1, model.size), covariance_of(model.size, 2)
    own, book = FormationFilter(model, start, spread, form=form), Textbook(model, start, spread)
    for k in range(30):
        forces = normals(100 + k, 3 * vehicles)
        own.predict((k + 1) * STEP_NS, forces)
        book.predict(STEP_S, forces)
        two: tuple[Pair, ...] = (pairs[(3 * k) % len(pairs)], pairs[k % len(pairs)])
        seen = [
            Observation(two, normals(200 + k, 6), covariance_of(6, k)),
            Observation((pairs[(5 * k) % len(pairs)],), normals(300 + k, 6), covariance_of(6, k + 1)),
        ]
        own.update(seen)
        H = np.vstack([model.output_map(each.pairs, velocities=each.velocities) for each in seen])
        noise = np.zeros((12, 12))
        noise[:6, :6], noise[6:, 6:] = seen[0].covariance, seen[1].covariance
        book.update(H, np.concatenate([each.values for each in seen]), noise)
    np.testing.assert_allclose(own.state, book.x, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(own.covariance, book.P, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(own.covariance, own.covariance.T)
    values, covariance = own.pair(vehicles - 1, 0)
    H = model.output_map([(vehicles - 1, 0)], velocities=True)
    np.testing.assert_allclose(values, H @ book.x, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(covariance, H @ book.P @ H.T, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("form", FORMS)
def test_a_sharp_measurement_after_a_vague_beginning_leaves_a_true_covariance(form: Form) -> None:
    """From kilometres to micrometres in one update: the variance is the noise's, and P is still one.

    P − P Hᵀ S⁻¹ H P would cancel: 10⁶ m² less itself leaves 10⁻¹⁰ m² of rounding beside the 10⁻¹² m² that are true.
    """
    own = FormationFilter(FormationModel(3), np.zeros(12), (1e3, 1.0), form=form)
    own.update([sighting(0, 1, [1.0, 2.0, 3.0], 1e-6), sighting(1, 2, [1.0, 2.0, 3.0], 1e-6)])
    np.testing.assert_allclose(own.covariance.diagonal()[[0, 1, 2, 6, 7, 8]], 1e-12, rtol=1e-3)
    np.linalg.cholesky(own.covariance)


def oracle_errors(seed: int, steps: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Error and covariance at the end of the centralised filter, in a world that is as it believes."""
    model = FormationModel(3)
    vehicles = normals(seed, 3, 6) * np.repeat([1.0, 0.5], 3)
    own = FormationFilter(model, np.zeros(12), _prior())
    draws = normals(seed + 10_000, steps, 5, 3, 3)
    for k in range(steps):
        accelerations = draws[k, 0] * model.acceleration_noise + 0.3 * draws[k, 1] / model.mass_kg
        vehicles[:, :3] += STEP_S * vehicles[:, 3:] + STEP_S**2 / 2 * accelerations
        vehicles[:, 3:] += STEP_S * accelerations
        own.predict((k + 1) * STEP_NS, 0.3 * draws[k, 1])
        ring = [(0, 1), (1, 2), (2, 0)]
        own.update(
            [sighting(i, j, vehicles[i, :3] - vehicles[j, :3] + 0.02 * draws[k, 2, i], 0.02) for i, j in ring[k % 2 :]]
        )
    return own.state - moved(vehicles), own.covariance


def _prior() -> NDArray[np.float64]:
    """Of vehicles whose positions are uncertain by 1 m and velocities by 0.5 m/s each, about 0."""
    difference = np.kron(np.eye(3)[:-1] - np.eye(3)[1:], np.eye(6))
    spread: NDArray[np.float64] = difference @ np.diag(np.tile(np.repeat([1.0, 0.25], 3), 3)) @ difference.T
    return spread


def test_nees_of_the_centralised_filter_is_in_its_bounds() -> None:
    """Over 80 seeds, each of 20 steps; at confidence 1 − 1e-6, a covariance off by a factor of 1.4 falls outside."""
    errors, covariances = (np.array(side) for side in zip(*(oracle_errors(s, 20) for s in range(80)), strict=True))
    low, high = metrics.chi_square_bounds(12, 80, 1 - 1e-6)
    mean = metrics.nees(errors, covariances).mean()
    assert low < mean < high
    assert mean * 1.4 > high
    assert mean / 1.4 < low


def test_bad_models_and_observations_are_refused_with_what_would_do() -> None:
    """One vehicle, values that are not above 0, covariances that are none, pairs that do not exist, lengths."""
    for fields in ({"vehicles": 1}, {"step_ns": 0}, {"mass_kg": -1.0}, {"acceleration_noise": float("nan")}):
        with pytest.raises(BadInput, match=r"give 2 vehicles|must be above 0 and finite"):
            FormationModel(**{"vehicles": 3, **fields})  # type: ignore[arg-type]
    model = FormationModel(3)
    for state, covariance in ((np.zeros(11), (1, 1)), (np.zeros(12), (1, 0)), (np.zeros(12), -np.eye(12))):
        with pytest.raises(BadInput):
            FormationFilter(model, state, covariance)
    lopsided = np.eye(12)
    lopsided[0, 1] = 0.5
    with pytest.raises(BadInput, match="not symmetric"):
        FormationFilter(model, np.zeros(12), lopsided)
    with pytest.raises(BadInput, match="3 values a pair"):
        Observation(((0, 1),), np.zeros(4), np.eye(4))
    with pytest.raises(BadInput, match="above 0"):
        sighting(0, 1, np.zeros(3), 0.0)
    for form in FORMS:
        own = FormationFilter(model, np.zeros(12), form=form)
        for pair in ((0, 3), (-1, 0), (1, 1)):
            with pytest.raises(BadInput, match="no pair here"):
                own.update([sighting(*pair, np.zeros(3), 0.1)])
        with pytest.raises(BadInput, match="positive definite"):
            own.update([Observation(((0, 1),), np.ones(3), np.diag([1.0, 1.0, 0.0]))])
        with pytest.raises(BadInput, match="not finite"):
            own.update([Observation(((0, 1),), np.array([0.0, np.nan, 0.0]), np.eye(3))])
        np.testing.assert_array_equal(own.state, np.zeros(12))
        np.testing.assert_array_equal(own.covariance, np.eye(12))


def test_a_step_that_does_not_go_forward_or_goes_too_far_is_refused_and_changes_nothing() -> None:
    """A dt ≤ 0 or above the bound; forces of a wrong length or not finite."""
    own = FormationFilter(FormationModel(3), np.ones(12), time_ns=10, longest_step_ns=100)
    forces = np.zeros(9)
    for time_ns in (10, 9, 111):
        with pytest.raises(BadInput, match="at most"):
            own.predict(time_ns, forces)
    for wrong, reason in ((np.zeros(6), "3 for each of 3"), (np.full(9, np.inf), "forces .* not finite")):
        with pytest.raises(BadInput, match=reason):
            own.predict(110, wrong)
    np.testing.assert_array_equal(own.state, np.ones(12))
    own.predict(110, forces)
    assert own.time_ns == 110


def test_the_compiled_form_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without Numba it is refused with what to install; the others need none."""
    monkeypatch.setitem(sys.modules, "numba", None)
    monkeypatch.delitem(sys.modules, "volery.estimators.formation.compiled", raising=False)
    FormationFilter(FormationModel(3), np.zeros(12), form="joseph")
    FormationFilter(FormationModel(3), np.zeros(12), form="square-root")
    with pytest.raises(BadInput, match=r"pip install 'volery\[fast\]', or choose joseph"):
        FormationFilter(FormationModel(3), np.zeros(12), form="compiled")
