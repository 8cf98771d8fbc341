"""Distributed filters against the centralised one, and what loss and lateness do to them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.estimators.distributed.covariance_intersection import intersection
from volery.estimators.distributed.filtering import Filter, Moment, Place
from volery.estimators.distributed.filters import FILTERS, choose_filter
from volery.estimators.distributed.gaussian import Gaussian, Measurement, information, measured_information
from volery.estimators.information import InformationPair, pack_pair, unpack_pair
from volery.topologies import agents, complete, geometric, ring, star

from .tracking import (
    NOISE_M,
    PRIOR,
    STEP,
    anees,
    bernoulli,
    one_way,
    overconfidence,
    path,
    track,
    truth,
)

EXACT_AVERAGE = ["consensus-on-measurements", "hybrid", "hybrid-contributions", "information-weighted"]
"""Filters that are the centralised one where the average is exact."""
CONSISTENT = ["local", "consensus-on-information", "hybrid-contributions", "covariance-intersection"]
"""Filters that never claim more than they know, and whose gains do not hang on the measurements."""


def apart(found: dict[str, list[Gaussian]], centralised: tuple[Gaussian, ...]) -> float:
    """Largest difference to the centralised filter, of means and covariances, in its standard deviations."""
    worst = 0.0
    for beliefs in found.values():
        for belief, best in zip(beliefs, centralised, strict=True):
            factor = np.linalg.cholesky(best.covariance)
            worst = max(worst, float(np.linalg.norm(np.linalg.solve(factor, belief.mean - best.mean))))
            ratio = np.linalg.solve(factor, np.linalg.solve(factor, belief.covariance).T)
            worst = max(worst, float(np.abs(ratio - np.eye(4)).max()))
    return worst


@pytest.mark.parametrize(
    ("name", "rounds"),
    [
        ("kalman-consensus-2007", 1),
        ("kalman-consensus-2009", 1),
        ("diffusion", 2),
        *((name, 1) for name in EXACT_AVERAGE),
        *((f"consensus-on-measurements/{law}", 1) for law in ("push-sum", "running-sum", "chebyshev")),
        ("consensus-on-measurements/flow-updating", 150),
    ],
)
def test_on_the_complete_graph_without_loss_a_filter_is_the_centralised_one(name: str, rounds: int) -> None:
    """To rounding, 1e-9 of a standard deviation; flow updating oscillates and takes a hundred rounds and more."""
    graph = complete(5)
    found = track(name, graph, rounds=rounds, samples=8)
    assert apart(found, truth(tuple(agents(graph)), 1, 8).centralised) < 1e-9


@pytest.mark.parametrize("averaging", ["metropolis", "constant-edge", "fastest-mixing", "chebyshev", "running-sum"])
@pytest.mark.parametrize("name", EXACT_AVERAGE)
def test_with_enough_rounds_a_filter_is_the_centralised_one(name: str, averaging: str) -> None:
    """The slowest here, Metropolis on this graph, contracts by 0.8 a round: 0.8⁹⁰ is 2e-9, times some tens of 1/σ²."""
    graph = geometric(6, 0.6, 3)
    found = track(f"{name}/{averaging}", graph, rounds=90, samples=4)
    assert apart(found, truth(tuple(agents(graph)), 1, 4).centralised) < 1e-6


def test_with_few_rounds_the_error_to_the_centralised_filter_is_the_consensus_error() -> None:
    """On a ring of 6 Metropolis contracts by 2/3 a round: ten rounds more leave (2/3)¹⁰ of the error, 1.7 %."""
    graph, best = ring(6), truth(tuple(agents(ring(6))), 1, 1).centralised
    few, more = (apart(track("hybrid", graph, rounds=rounds, samples=1), best) for rounds in (20, 30))
    assert more / few == pytest.approx((2 / 3) ** 10, rel=0.05)


@pytest.mark.parametrize("name", CONSISTENT)
@settings(max_examples=4)
@given(seed=st.integers(0, 1000), probability=st.sampled_from([0.3, 0.6, 0.9]))
def test_consistent_filters_never_claim_more_than_they_know(name: str, seed: int, probability: float) -> None:
    """Whatever is lost, and half of the messages a sample late: no variance exceeds the one that is claimed."""
    how = {"lost": bernoulli(seed, probability), "late": lambda number: number % 2}
    assert overconfidence(name, ring(4), samples=4, rounds=2, **how) <= 1.0 + 1e-9


def test_weights_of_n_become_overconfident_under_loss() -> None:
    """Exact averages make the hybrid with ω = N honest; with lost ones an agent counts its own measurement N times.

    Where all is lost, the variance that an agent with a sensor claims is that of N measurements and it has one.
    """
    assert overconfidence("hybrid", ring(4), samples=3, rounds=60) == pytest.approx(1.0, abs=1e-6)
    assert overconfidence("hybrid", ring(4), samples=3, rounds=2, lost=bernoulli(1, 0.6)) > 1.5
    assert overconfidence("hybrid", ring(4), samples=3, rounds=2, lost=lambda *_: True) > 3.0


def test_consensus_on_information_has_an_anees_of_at_most_one() -> None:
    """As measured over 12 paths: 0.4 to 0.5, and 1 + 3 √(2 / (4 · 12)) = 1.61 would be chance for one agent."""
    graph, names = ring(6), tuple(agents(ring(6)))
    for name in ("consensus-on-information", "event-triggered"):
        values = []
        for seed in range(12):
            found = track(name, graph, samples=20, seed=seed, lost=bernoulli(seed, 0.6))
            values.append(anees(found, truth(names, seed, 20).states))
        assert 0.1 < np.mean(values) < 1.0


@pytest.mark.parametrize("probability", [0.0, 0.6])
def test_the_information_weighted_filter_is_the_hybrid_with_weights_n(probability: float) -> None:
    """To rounding, whatever is lost."""
    graph = geometric(6, 0.6, 3)
    first, second = (
        track(name, graph, samples=12, lost=bernoulli(3, probability)) for name in ("information-weighted", "hybrid")
    )
    for who in first:
        for one, other in zip(first[who], second[who], strict=True):
            np.testing.assert_allclose(one.mean, other.mean, atol=1e-9 * NOISE_M)
            np.testing.assert_allclose(one.covariance, other.covariance, atol=1e-9 * NOISE_M**2)


def test_under_one_way_loss_robust_averages_stay_exact_and_the_others_are_biased() -> None:
    """Half of all messages of one direction lost, 150 rounds: 1e-6 of a standard deviation against tenths."""
    graph = ring(5)
    best = truth(tuple(agents(graph)), 1, 3).centralised
    for averaging, exact in {
        "running-sum": True,
        "flow-updating": True,
        "push-sum": False,
        "metropolis": False,
    }.items():
        name = f"consensus-on-measurements/{averaging}"
        found = apart(track(name, graph, rounds=150, samples=3, lost=one_way(2, 0.5)), best)
        assert found < 1e-6 if exact else found > 0.1


def test_late_beliefs_are_run_forward_and_help() -> None:
    """All messages one or two samples late: agents that see nothing still follow, and none is overconfident."""
    graph, names = ring(6), tuple(agents(ring(6)))
    seen = truth(names, 1, 30)
    for name in ("consensus-on-information", "hybrid-contributions", "covariance-intersection"):
        found = track(name, graph, samples=30, late=lambda number: 1 + number % 2)
        alone = track("local", graph, samples=30)
        for blind in names[2::3]:
            mine, lone = (np.trace(beliefs[blind][-1].covariance[:2, :2]) for beliefs in (found, alone))
            assert mine < 0.1 * lone
        assert anees(found, seen.states) < 1.0


def test_a_message_older_than_the_model_is_remembered_is_worth_nothing() -> None:
    """One step is remembered, the message is two samples old."""
    one = choose_filter("consensus-on-information").make(Place("1", ("1", "2"), 1), PRIOR)
    for sample in range(3):
        one.begin(Moment(sample, None, (STEP,) * min(sample, 1), {"2": 0.5}))
    told = one.message("2")
    assert told is not None
    once = one.forward(told, 1)
    assert once is not None
    assert one.forward(told, 2) is None
    np.testing.assert_allclose(once, pack_pair(information(_predicted(told))))


def _predicted(told: NDArray[np.float64]) -> Gaussian:
    pair = unpack_pair(told)
    P = np.linalg.solve(pair.P, np.eye(4))
    return Gaussian(STEP.transition @ P @ pair.q, STEP.transition @ P @ STEP.transition.T + STEP.noise)


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_a_filter_that_hears_nothing_does_no_worse_than_it_says(name: str) -> None:
    """Cut off, each filter goes on; those that multiply by N are the ones that may be overconfident."""
    found = track(name, ring(4), samples=12, lost=lambda *_: True)
    alone = track("local", ring(4), samples=12)
    for who in found:
        assert np.linalg.eigvalsh(found[who][-1].covariance)[0] > 0
        if name not in (*EXACT_AVERAGE, "kalman-consensus-2007") or name == "hybrid-contributions":
            np.testing.assert_allclose(found[who][-1].mean, alone[who][-1].mean, rtol=1e-6)


def test_no_measurement_counts_more_than_once_in_the_hybrid_by_contributions() -> None:
    """On a star after one round the hub's ω is 1 / its own weight, not N."""
    graph = star(5)
    found = track("hybrid-contributions", graph, rounds=1, samples=1)
    full, naive = truth(tuple(agents(graph)), 1, 1).centralised[0], PRIOR
    for beliefs in found.values():
        information_gained = np.linalg.inv(beliefs[0].covariance) - np.linalg.inv(naive.covariance)
        most = np.linalg.inv(full.covariance) - np.linalg.inv(naive.covariance)
        assert np.linalg.eigvalsh(most - information_gained)[0] > -1e-12


def test_events_save_messages_and_without_thresholds_nothing_is_lost() -> None:
    """With all thresholds 0 it is consensus on information; with the defaults at most two thirds of the messages go."""
    graph = ring(6)
    plain = track("consensus-on-information", graph, samples=20)
    always = track("event-triggered", graph, samples=20, alpha=0.0, beta=0.0, delta=0.0)
    for who in plain:
        np.testing.assert_allclose(always[who][-1].mean, plain[who][-1].mean, rtol=1e-9)
    sent: list[int] = []

    def counted(_source: str, _target: str, number: int) -> bool:
        sent.append(number)
        return False

    track("event-triggered", graph, samples=20, lost=counted)
    assert 0.1 < len(sent) / (20 * 3 * 12) < 0.67


@pytest.mark.parametrize(
    ("told", "shift", "news"),
    [
        (0.56, 0.0, False),  # Ω̄ ≼ (1 + δ) Ω ends at Ω = 1 / 1.3, that is where the neighbour's is 0.538
        (0.52, 0.0, True),
        (1.58, 0.0, False),  # Ω ≼ (1 + β) Ω̄ ends at Ω = 1.3, where the neighbour's is 1.6
        (1.62, 0.0, True),
        (1.4, 1.19, False),  # the mean moves by shift / 2 / Ω with Ω = 1.2: (shift / 2)² / Ω = α at a shift of 1.2
        (1.4, 1.21, True),
    ],
)
def test_each_threshold_of_an_event_is_where_the_paper_has_it(told: float, shift: float, news: bool) -> None:
    """(10) of Battistelli 2018 at α = β = δ = 0.3: Ω̄ = 1 was sent, Ω is its average with one neighbour's."""
    one = choose_filter("event-triggered").make(Place("1", ("1", "2"), 2), Gaussian(np.zeros(2), np.eye(2)))
    one.begin(Moment(0, None, (), {"2": 0.5}))
    assert one.message("2") is not None
    one.hear({"2": pack_pair(InformationPair(np.diag([told, 1.0]), np.array([shift, 0.0])))})
    assert (one.message("2") is not None) == news


@given(seed=st.integers(0, 10**6))
def test_covariance_intersection_has_the_smallest_determinant_on_the_segment(seed: int) -> None:
    """No ω of a fine grid does better; the tolerance is the grid's."""
    draws = np.random.default_rng(seed)
    pairs = []
    for _ in range(2):
        factor = draws.normal(size=(3, 3)) + 0.1 * np.eye(3)
        pairs.append(information(Gaussian(draws.normal(size=3), factor @ factor.T + 1e-3 * np.eye(3))))
    joined = intersection(*pairs)
    grid = [np.linalg.slogdet(w * pairs[0].P + (1 - w) * pairs[1].P)[1] for w in np.linspace(0, 1, 101)]
    found = np.linalg.slogdet(joined.P)[1]
    assert found >= max(grid) - 1e-9
    assert found <= max(grid) + 0.05


def test_names_options_and_averagings_are_checked() -> None:
    """The message says what there is."""
    with pytest.raises(BadInput, match="did you mean 'local'"):
        choose_filter("locale")
    with pytest.raises(BadInput, match="averaging 'mean' is not known: use metropolis"):
        choose_filter("hybrid/mean")
    with pytest.raises(BadInput, match="no option 'gian': it has gain"):
        choose_filter("kalman-consensus-2009", {"gian": 0.1})
    with pytest.raises(BadInput, match=r"not a subclass of volery\.estimators\.distributed\.filtering\.Filter"):
        choose_filter("collections:OrderedDict")
    with pytest.raises(BadInput, match="cannot be loaded"):
        choose_filter("no_such_module:Filter")
    with pytest.raises(BadInput, match="gain is 0, it must be above 0"):
        choose_filter("kalman-consensus-2007", {"gain": 0.0}).make(Place("1", ("1",), 1), PRIOR)
    with pytest.raises(BadInput, match="alpha is -1, it must be at least 0"):
        choose_filter("event-triggered", {"alpha": -1.0}).make(Place("1", ("1",), 1), PRIOR)


def test_a_filter_of_ones_own_is_found_by_its_module() -> None:
    """And runs."""
    found = track(f"{__name__}:Deaf", ring(3), samples=2)
    assert found["1"][1].covariance[0, 0] == pytest.approx(PRIOR.covariance[0, 0] + 0.25 * 4.0 + STEP.noise[0, 0])


class Deaf(Filter):
    """It predicts and does no more."""


def test_the_noises_of_a_path_are_drawn_in_a_fixed_number() -> None:
    """What `overconfidence` counts on: 4 for the start, 4 a step, and one a measurement."""
    drawn = iter(range(10**6))
    path(("1", "2", "3"), 5, (float(number) for number in drawn))
    assert next(drawn) == 4 * 5 + 2 * 5


@pytest.mark.parametrize("year", [2007, 2009])
def test_the_kalman_consensus_filters_take_their_gains_from_the_papers(year: int) -> None:
    """One sample with two neighbours, against the papers' formulas with explicit inverses.

    The consensus gain of 2007 comes from the posterior covariance, that of 2009 from the prior, which is far larger.
    """
    draws = np.random.default_rng(year)
    prior = Gaussian(draws.normal(size=4), np.diag([4.0, 9.0, 1.0, 2.0]) + 0.3)
    told = {name: draws.normal(size=4) for name in ("2", "3")}
    seen = {name: (draws.normal(size=(2, 4)), draws.normal(size=2)) for name in ("1", "2", "3")}
    R = np.diag([0.2, 0.5])
    one = choose_filter(f"kalman-consensus-{year}", {"gain": 0.1}).make(Place("1", ("1", "2", "3"), 1), prior)
    H, z = seen["1"]
    one.begin(Moment(0, Measurement(H, R, z), (), {"2": 0.3, "3": 0.3}))
    one.hear(
        {
            name: np.concatenate([told[name], pack_pair(measured_information(Measurement(H, R, z), 4))])
            for name, (H, z) in seen.items()
            if name in told
        }
    )
    found = one.end()

    S = sum((H.T @ np.linalg.inv(R) @ H for H, _ in seen.values()), np.zeros((4, 4)))
    y = sum((H.T @ np.linalg.inv(R) @ z for H, z in seen.values()), np.zeros(4))
    P = prior.covariance
    M = np.linalg.inv(np.linalg.inv(P) + S)
    C = 0.1 * M if year == 2007 else 0.1 * P / (1.0 + np.sqrt(np.sum(P**2)))
    pull = sum((mean - prior.mean for mean in told.values()), np.zeros(4))
    np.testing.assert_allclose(found.covariance, M, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.mean, prior.mean + M @ (y - S @ prior.mean) + C @ pull, rtol=1e-9, atol=1e-12)


def test_the_kalman_consensus_filter_of_2007_diverges_where_its_gain_is_not_small() -> None:
    """On a ring whose neighbourhoods do not all see both coordinates: ten times the default is kilometres off."""
    graph, states = ring(10), truth(tuple(agents(ring(10))), 1, 60).states
    errors = {}
    for gain in (1e-4, 1e-3):
        found = track("kalman-consensus-2007", graph, rounds=1, samples=60, gain=gain)
        errors[gain] = max(float(np.abs(beliefs[-1].mean - states[-1])[:2].max()) for beliefs in found.values())
    assert errors[1e-4] < 10.0
    assert errors[1e-3] > 1000.0
