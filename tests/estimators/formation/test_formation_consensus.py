"""Messages of a formation: run forward, folded, counted; what complete information gives, and what repetition costs."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.estimators import error_measures as metrics
from volery.estimators.formation.control import control, regulator
from volery.estimators.formation.filter import Form, FormationFilter, Observation, sighting
from volery.estimators.formation.formation_consensus import ConsensusFilter, ConsensusSettings, Delay, Fusion
from volery.estimators.formation.formation_messages import FullMessage, History, Message, PairMessage, run_forward
from volery.estimators.formation.model import FormationModel
from volery.randomness import Stream, stream

MODEL = FormationModel(3)
STEP_NS = MODEL.step_ns
STEP_S = STEP_NS * 1e-9
RING = ((0, 1), (1, 2), (2, 0))
STILL = np.zeros((3, 3))


def fresh(settings: ConsensusSettings | None = None, spread: float = 0.3) -> ConsensusFilter:
    """A vehicle's filter at the beginning."""
    return ConsensusFilter(FormationFilter(MODEL, np.zeros(12), (spread, spread)), settings or ConsensusSettings())


def told(time_ns: int, values: NDArray[np.float64] | None = None, sender: int = 1, seen: int = 2) -> PairMessage:
    """A message about a pair."""
    return PairMessage(sender, seen, time_ns, np.zeros(6) if values is None else values)


def vector(draws: Stream, index: int, size: int) -> NDArray[np.float64]:
    """The index-th vector of standard normal draws."""
    return np.array([draws.normal(index * size + i) for i in range(size)])


def relative(vehicles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The state of vehicles with these positions and velocities, shape (N, 6)."""
    return (vehicles[:-1] - vehicles[1:]).ravel()


@pytest.mark.parametrize("age_ns", [0, 1, STEP_NS // 3, STEP_NS, 5 * STEP_NS + 17, 12 * STEP_NS])
def test_a_late_message_of_noise_free_motion_is_run_forward_to_where_the_vehicles_are(age_ns: int) -> None:
    """Exactly, from any instant, also within a step, under forces that change with each step; tolerance: rounding."""
    draws = stream(1, "test", "late")
    history = History(MODEL, 0, 12 * STEP_NS)
    vehicles, then = vector(draws, 0, 18).reshape(3, 6), np.zeros((3, 6))
    when_ns = 12 * STEP_NS - age_ns
    for k in range(12):
        forces = vector(draws, 10 + k, 9).reshape(3, 3)
        into_ns = when_ns - k * STEP_NS
        if 0 <= into_ns <= STEP_NS:
            then = pushed(vehicles, forces, into_ns * 1e-9)
        vehicles = pushed(vehicles, forces, STEP_S)
        history.record((k + 1) * STEP_NS, forces)
    seen = PairMessage(2, 0, when_ns, then[2] - then[0])
    now = run_forward(MODEL, history, seen, np.eye(6))
    np.testing.assert_allclose(now.values, vehicles[2] - vehicles[0], rtol=0, atol=1e-13)
    whole = run_forward(MODEL, history, FullMessage(2, when_ns, relative(then)), np.eye(12))
    np.testing.assert_allclose(whole.values, relative(vehicles), rtol=0, atol=1e-13)


def pushed(vehicles: NDArray[np.float64], forces: NDArray[np.float64], seconds: float) -> NDArray[np.float64]:
    """Positions and velocities after so long under these forces."""
    acceleration = forces / MODEL.mass_kg
    place = vehicles[:, :3] + seconds * vehicles[:, 3:] + seconds**2 / 2 * acceleration
    return np.hstack([place, vehicles[:, 3:] + seconds * acceleration])


def test_what_is_run_forward_is_less_certain_by_the_noise_of_the_time_in_between() -> None:
    """N⁺ = Φ N Φᵀ + Q, over the age and the time that the sender had not seen it; neighbours stay correlated."""
    history = History(MODEL, 0, 10 * STEP_NS)
    for k in range(10):
        history.record((k + 1) * STEP_NS, STILL)
    noise = ConsensusSettings().noise(1)
    stale = PairMessage(1, 2, 6 * STEP_NS, np.zeros(6), unseen_ns=3 * STEP_NS)
    A = MODEL.transition(7 * STEP_S)[:6, :6]
    expected = A @ noise @ A.T + MODEL.process_noise(7 * STEP_S)[:6, :6]
    np.testing.assert_allclose(run_forward(MODEL, history, stale, noise).covariance, expected, rtol=1e-12)
    whole = run_forward(MODEL, history, FullMessage(1, 6 * STEP_NS, np.zeros(12)), ConsensusSettings().noise(2))
    A = MODEL.transition(4 * STEP_S)
    expected = A @ ConsensusSettings().noise(2) @ A.T + MODEL.process_noise(4 * STEP_S)
    np.testing.assert_allclose(whole.covariance, expected, rtol=1e-12, atol=1e-18)


def test_ignored_delay_takes_an_old_message_as_if_it_were_fresh() -> None:
    """A pair that moves apart at 1 m/s: told 0.2 s ago, it is taken for 20 cm nearer than it is, or run forward."""
    means = {}
    for delay in ("ignore", "compensate"):
        one = fresh(ConsensusSettings(delay=delay), spread=10.0)
        for k in range(6):
            one.predict((k + 1) * STEP_NS, STILL)
        one.receive(told(0, np.array([2.0, 0.0, 0.0, 1.0, 0.0, 0.0])))
        one.update([])
        means[delay] = one.own.pair(1, 2)[0][0]
    # The prior of 10 m moves the estimate by some 10⁻⁴ of it.
    assert means["ignore"] == pytest.approx(2.0, abs=0.01)
    assert means["compensate"] == pytest.approx(2.2, abs=0.01)


def test_independent_data_heard_by_all_gives_all_the_centralised_estimate() -> None:
    """In every step each vehicle hears what the others have measured, positions and velocities, and the true forces.

    The messages' errors are then independent, as the filter takes them to be, and what is folded is what the
    centralised filter folds, in another order. Tolerance: rounding, over 20 steps.
    """
    draws = stream(2, "test", "complete")
    centre = FormationFilter(MODEL, np.zeros(12), (0.3, 0.3))
    all_three = [fresh() for _ in RING]
    noise = np.diag([4e-4] * 3 + [1e-2] * 3)
    for k in range(20):
        now_ns, forces = (k + 1) * STEP_NS, vector(draws, k, 9)
        measured = [np.sqrt(noise.diagonal()) * vector(draws, 100 + 3 * k + i, 6) for i in range(3)]
        centre.predict(now_ns, forces)
        centre.update([Observation((pair,), z, noise) for pair, z in zip(RING, measured, strict=True)])
        for i, one in enumerate(all_three):
            one.predict(now_ns, forces)
            for (sender, seen), values in zip(RING, measured, strict=True):
                if sender != i:
                    one.receive(PairMessage(sender, seen, now_ns, values, covariance=noise))
            one.update([Observation((RING[i],), measured[i], noise)])
    for one in all_three:
        np.testing.assert_allclose(one.own.state, centre.state, rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.own.covariance, centre.covariance, rtol=0, atol=1e-12)


class Flock:
    """Three vehicles in a world that is as their filters believe, whose messages are lost at random."""

    def __init__(self, seed: int, settings: ConsensusSettings, loss: float) -> None:
        self.filters = [fresh(settings) for _ in RING]
        self.centre = FormationFilter(MODEL, np.zeros(12), (0.3, 0.3))
        self.vehicles = np.zeros((3, 6))
        self._truth, self._seen = stream(seed, "test", "truth"), stream(seed, "test", "seen")
        self._lost, self._loss, self._k = stream(seed, "test", "lost"), loss, 0
        start = 0.3 * vector(stream(seed, "test", "start"), 0, 12)
        self.vehicles[1] = -start[:6]
        self.vehicles[2] = -start[:6] - start[6:]

    def step(self) -> None:
        """One of the camera; every sixth, messages that may be lost."""
        self._k += 1
        pushes = MODEL.acceleration_noise * MODEL.mass_kg * vector(self._truth, self._k, 9).reshape(3, 3)
        self.vehicles = pushed(self.vehicles, pushes, STEP_S)
        now_ns, seen = self._k * STEP_NS, []
        for i, j in RING:
            error = 0.02 * vector(self._seen, 3 * self._k + i, 3)
            seen.append(sighting(i, j, self.vehicles[i, :3] - self.vehicles[j, :3] + error, 0.02))
        self.centre.predict(now_ns, STILL)
        self.centre.update(seen)
        for i, one in enumerate(self.filters):
            one.predict(now_ns, STILL)
            one.update([seen[i]])
        if self._k % 6 == 0:
            messages = [one.pair_message(*pair) for one, pair in zip(self.filters, RING, strict=True)]
            for i, one in enumerate(self.filters):
                for sender, message in enumerate(messages):
                    if sender != i and self._lost.uniform(9 * self._k + 3 * i + sender) >= self._loss:
                        one.receive(message)

    def nees(self) -> float:
        """Mean over the vehicles."""
        truth = relative(self.vehicles)
        return float(np.mean([metrics.nees(one.own.state - truth, one.own.covariance) for one in self.filters]))


def test_estimates_that_come_back_are_counted_again() -> None:
    """Everybody hears everybody's estimate: each then claims a smaller covariance than the filter that has all data.

    No estimate has less error than that one, so the claim is wrong. Covariance intersection does not make it.
    """
    shares = {}
    for fusion in ("kalman", "intersection"):
        flock = Flock(1, ConsensusSettings(fusion=fusion), loss=0.0)
        for _ in range(61):  # messages of the 60th step are folded in the 61st
            flock.step()
        least = np.linalg.eigvalsh(flock.centre.covariance)
        shares[fusion] = max(np.linalg.slogdet(one.own.covariance)[1] - np.log(least).sum() for one in flock.filters)
    assert shares["kalman"] < 0.0
    assert shares["intersection"] > 0.0


def test_the_consensus_filter_is_overconfident_under_loss_and_covariance_intersection_is_not() -> None:
    """Loss of 30 %, 10 seeds, in a world as they believe: NEES of 12 states against its bound at 1 − 1e-6.

    Six values of a seed, 0.4 s apart, count as independent: by then a camera's filter has forgotten all but 0.76¹² = 3
    % of its error. The three vehicles of a seed, which are correlated, count as one.
    """
    mean = {}
    for fusion in ("kalman", "intersection"):
        flocks = [Flock(seed, ConsensusSettings(fusion=fusion), loss=0.3) for seed in range(10)]
        values = []
        for flock in flocks:
            for k in range(1, 92):
                flock.step()
                if k in range(31, 92, 12):
                    values.append(flock.nees())
        mean[fusion] = np.mean(values)
    bound = metrics.chi_square_bounds(12, 60, 1 - 1e-6)[1]
    assert mean["kalman"] > bound
    assert mean["intersection"] < 12.0 < bound


@pytest.mark.parametrize("form", ["joseph", "compiled"])
def test_covariances_stay_what_they_are_over_a_long_flight(form: Form) -> None:
    """A minute of intersections, each of which enlarges the covariance: as the square-root form has it.

    Against that one, which cannot lose symmetry or sign. Tolerance: rounding of 1,800 steps, which all contract.
    """
    if form == "compiled":
        pytest.importorskip("numba")
    settings = ConsensusSettings(fusion="intersection", weighting="fast")
    both = [
        ConsensusFilter(FormationFilter(MODEL, np.zeros(12), (0.3, 0.3), form=kind), settings)
        for kind in (form, "square-root")
    ]
    seen, message = sighting(0, 1, np.zeros(3), 0.02), np.diag(np.repeat([0.013**2, 0.17**2], 3))
    for k in range(1, 1801):
        for one in both:
            one.predict(k * STEP_NS, STILL)
            if k % 6 == 0:
                for sender in (1, 2):
                    one.receive(replace(told(k * STEP_NS, sender=sender, seen=RING[sender][1]), covariance=message))
            one.update([seen])
    own, root = (one.own.covariance for one in both)
    np.testing.assert_allclose(own, root, rtol=0, atol=1e-9 * np.abs(root).max())
    np.linalg.cholesky(own)


def late_nees(seed: int, fusion: Fusion) -> list[float]:
    """NEES, a second apart, of a vehicle that is blind and hears independent measurements 0.4 s late."""
    model, late = FormationModel(2), 12
    own = FormationFilter(model, np.zeros(6), (0.3, 0.3))
    one = ConsensusFilter(own, ConsensusSettings(fusion=fusion))
    truth, errors = stream(seed, "test", "late truth"), stream(seed, "test", "late error")
    noise, pair, seen, values = one.settings.noise(1), 0.3 * vector(truth, 0, 6), [], []
    for k in range(1, 181):
        push = model.acceleration_noise * np.subtract(*vector(truth, k, 6).reshape(2, 3))
        pair[:3] += STEP_S * pair[3:] + STEP_S**2 / 2 * push
        pair[3:] += STEP_S * push
        seen.append(PairMessage(0, 1, k * STEP_NS, pair + np.sqrt(noise.diagonal()) * vector(errors, k, 6)))
        one.predict(k * STEP_NS, np.zeros(6))
        if k % 6 == 0 and k > late:
            one.receive(replace(seen[k - late - 1], covariance=noise))
        one.update([])
        if k % 30 == 0 and k > 30:
            values.append(float(metrics.nees(own.state - pair, own.covariance)))
    return values


def test_messages_that_were_run_forward_far_claim_too_much_and_intersection_does_not() -> None:
    """What moved the vehicles meanwhile is in the own prediction too: NEES of 6 states against its bound at 1 − 1e-6.

    20 seeds of five values a second apart, by when five newer messages have come.
    """
    bound = metrics.chi_square_bounds(6, 100, 1 - 1e-6)[1]
    mean = {fusion: np.mean([late_nees(seed, fusion) for seed in range(20)]) for fusion in get_args(Fusion)}
    assert mean["kalman"] > bound
    assert mean["intersection"] < bound


def test_of_each_sender_the_newest_is_folded_once() -> None:
    """An older one of the same sender, a repetition, and one that was overtaken count as superseded."""
    one, other = fresh(), fresh()
    for each in (one, other):
        for k in range(6):
            each.predict((k + 1) * STEP_NS, STILL)
    newest = told(5 * STEP_NS, np.ones(6))
    for message in (told(2 * STEP_NS), newest, newest, told(STEP_NS)):
        one.receive(message)
    other.receive(newest)
    one.update([])
    other.update([])
    np.testing.assert_array_equal(one.own.state, other.own.state)
    assert (one.message_counts.folded, one.message_counts.superseded) == (1, 3)
    one.receive(newest)
    one.update([])
    np.testing.assert_array_equal(one.own.state, other.own.state)
    assert (one.message_counts.folded, one.message_counts.superseded) == (1, 4)


def test_messages_out_of_reach_are_dropped_and_counted() -> None:
    """Older than the history of forces, and further ahead than it is long; one a little ahead waits its turn."""
    one = fresh(ConsensusSettings(history_ns=4 * STEP_NS))
    for k in range(10):
        one.predict((k + 1) * STEP_NS, STILL)
    before = one.own.state
    for time_ns in (0, 5 * STEP_NS, 15 * STEP_NS, 11 * STEP_NS):
        one.receive(told(time_ns, np.ones(6), sender=time_ns // STEP_NS % 2))
    one.update([])
    assert (one.message_counts.too_old, one.message_counts.ahead, one.message_counts.folded) == (2, 1, 0)
    np.testing.assert_array_equal(one.own.state, before)
    one.predict(11 * STEP_NS, STILL)
    one.update([])
    assert one.message_counts.folded == 1
    assert not np.allclose(one.own.state, before)


@pytest.mark.parametrize(
    ("delay", "largest"),
    [("compensate", 0.5), ("ignore", np.inf)],
)
def test_latency_used_as_if_fresh_makes_the_loop_diverge(delay: Delay, largest: float) -> None:
    """0.3 s in closed loop for 10 s under gusts: the formation is off by less than half a metre, or more than two."""
    settings = ConsensusSettings(delay=delay)
    gain, vehicles = regulator(MODEL), np.zeros((3, 6))
    filters, draws, gust = [fresh(settings) for _ in RING], stream(3, "test", "loop"), np.zeros((3, 3))
    due: list[tuple[int, Message]] = []
    worst = 0.0
    for k in range(1, 301):
        now_ns = k * STEP_NS
        forces = [control(gain, one.own.state, np.zeros(12)) for one in filters]
        kept = np.exp(-STEP_S / 0.5)
        gust = kept * gust + 0.6 * np.sqrt(1 - kept**2) * vector(draws, 2 * k, 9).reshape(3, 3)
        own = np.array([forces[i][i] for i in range(3)])
        vehicles = pushed(vehicles, own + MODEL.mass_kg * gust, STEP_S)
        arrived, due = [m for at, m in due if at <= now_ns], [(at, m) for at, m in due if at > now_ns]
        for i, (_, j) in enumerate(RING):
            filters[i].predict(now_ns, forces[i])
            for message in arrived:
                if message.sender != i:
                    filters[i].receive(message)
            error = 0.02 * vector(draws, 3 * (2 * k + 1) + i, 3)
            filters[i].update([sighting(i, j, vehicles[i, :3] - vehicles[j, :3] + error, 0.02)])
        if k % 6 == 0:
            due += [(now_ns + 300_000_000, one.pair_message(*p)) for one, p in zip(filters, RING, strict=True)]
        worst = max(worst, float(np.abs(relative(vehicles[:, :3])).max()))
    assert worst < largest
    assert (worst > 2.0) == (delay == "ignore")


def test_messages_that_do_not_fit_are_refused() -> None:
    """A pair that does not exist, another formation, no covariance for intersection, settings out of bounds."""
    one = fresh()
    with pytest.raises(BadInput, match="no pair here"):
        one.receive(told(0, seen=3))
    with pytest.raises(BadInput, match="give 6 for each"):
        one.receive(told(0, np.zeros(3)))
    with pytest.raises(BadInput, match="this formation has 12"):
        one.receive(FullMessage(0, 0, np.zeros(6)))
    with pytest.raises(BadInput, match="a bound"):
        fresh(ConsensusSettings(fusion="intersection")).receive(told(0))
    with pytest.raises(BadInput, match="positive definite"):
        one.receive(PairMessage(1, 2, 0, np.zeros(6), covariance=np.zeros((6, 6))))
    for fields in ({"position_noise": 0.0}, {"velocity_noise": -1.0}, {"history_ns": 0}):
        with pytest.raises(BadInput, match="above 0"):
            ConsensusSettings(**fields)
