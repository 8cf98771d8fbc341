"""The laws of average consensus behind their common interface: without faults, with loss, asynchronous, rounded."""

from collections.abc import Callable
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.estimators.averages.laws import LAWS, ConsensusLaw
from volery.estimators.averages.running_sum import running_sum_round, running_sum_start
from volery.estimators.flying_array.least_squares import centralised_estimate
from volery.estimators.flying_array.metropolis import estimate, initial_pair
from volery.estimators.information import pack_pair, unpack_pair
from volery.randomness import stream
from volery.topologies import agents, complete, metropolis, natural_key, positions, random_hexagonal

Values = dict[str, NDArray[np.float64]]
ROBUST = ["running-sum", "flow-updating"]


def values_of(graph: nx.Graph, seed: int, size: int = 9) -> Values:
    """A vector for each agent, standard normal."""
    draws = stream(seed, "test", "values")
    return {n: np.array([draws.normal(size * k + i) for i in range(size)]) for k, n in enumerate(agents(graph))}


def started(law: str, graph: nx.Graph, values: Values) -> dict[str, object]:
    """The states of all agents at the beginning."""
    weights = metropolis(graph)
    return {i: LAWS[law].start(values[i], {j: weights[i][j] for j in graph[i]}) for i in agents(graph)}


def told(use: ConsensusLaw[Any], state: Any, to: str) -> NDArray[np.float64]:
    """The message of a law that has one in every round."""
    message = use.message(state, to)
    assert message is not None
    return message


def run(
    law: str,
    graph: nx.Graph,
    values: Values,
    rounds: int,
    lost: Callable[[str, str, int], bool] | None = None,
    wire: type = np.float64,
) -> Values:
    """The values after so many synchronous rounds with this pattern of loss and this encoding of messages."""
    use = LAWS[law]
    states = started(law, graph, values)
    for k in range(rounds):
        messages: list[tuple[str, str, Any]] = [
            (i, j, told(use, states[i], j).astype(wire)) for i in states for j in graph[i]
        ]
        for i, j, vector in messages:
            if lost is None or not lost(i, j, k):
                states[j] = use.receive(states[j], i, vector)
        states = {i: use.round(state) for i, state in states.items()}
    return {i: use.value(state) for i, state in states.items()}


def one_way_loss(seed: int, probability: float) -> Callable[[str, str, int], bool]:
    """Loss on one direction of each edge only: from the lower to the higher name."""

    def lost(source: str, target: str, k: int) -> bool:
        lossy = natural_key(source) < natural_key(target)
        return lossy and stream(seed, "test loss", source, target).uniform(k) < probability

    return lost


def error(found: Values, values: Values) -> float:
    """Largest distance of any agent to the true average."""
    average = np.mean(list(values.values()), axis=0)
    return max(float(np.linalg.norm(value - average)) for value in found.values())


@settings(max_examples=15)
@given(law=st.sampled_from(sorted(LAWS)), seed=st.integers(0, 1000), count=st.integers(2, 8))
def test_without_faults_every_law_reaches_the_average(law: str, seed: int, count: int) -> None:
    """A line of 8 is the slowest array: Metropolis contracts by 0.95 a round there, to 1e-13 in 600."""
    graph = random_hexagonal(count, seed)
    values = values_of(graph, seed)
    assert error(run(law, graph, values, 600), values) < 1e-9


@pytest.mark.parametrize("law", ["metropolis", "running-sum"])
def test_one_round_on_the_complete_graph_is_the_average(law: str) -> None:
    """All weights and all shares are 1/N there."""
    graph = complete(5)
    values = values_of(graph, 3)
    assert error(run(law, graph, values, 1), values) < 1e-14


def test_under_one_way_loss_running_sum_and_flow_updating_keep_the_average_and_metropolis_does_not() -> None:
    """30 % loss on one direction of every edge of an 8-module array: below 1e-6 after 300 rounds, Metropolis is off.

    Metropolis agrees on a wrong value: for vectors of 9 standard normal numbers its error is 0.34, 0.36, 0.26, 0.16 on
    these four arrays, a thousand times what its agents still disagree.
    """
    for seed in range(4):
        graph = random_hexagonal(8, seed)
        values = values_of(graph, seed)
        lost = one_way_loss(seed, 0.3)
        for law in ROBUST:
            assert error(run(law, graph, values, 300, lost), values) < 1e-6
        found = run("metropolis", graph, values, 300, lost)
        assert 0.1 < error(found, values) < 0.5
        assert np.ptp(list(found.values()), axis=0).max() < 1e-4


@pytest.mark.parametrize("law", sorted(LAWS))
def test_estimates_of_the_state_under_one_way_loss(law: str) -> None:
    """On noisy (P, q) the robust laws reach the centralised estimate; Metropolis is off by a part of the noise, 5 mm.

    Tolerance: the error of (P, q), below 1e-6, over the smallest eigenvalue of the mean P, about 0.02 m².
    """
    graph = random_hexagonal(8, 5)
    places = positions(graph)
    draws = stream(5, "test", "noise")
    measured = {name: 0.2 + 0.005 * draws.normal(k) for k, name in enumerate(agents(graph))}
    values = {name: pack_pair(initial_pair(places[name], measured[name])) for name in agents(graph)}
    optimum = centralised_estimate(list(places.values()), [measured[name] for name in places])
    found = [estimate(unpack_pair(v)) for v in run(law, graph, values, 300, one_way_loss(5, 0.3)).values()]
    errors = [np.linalg.norm(x - optimum) for x in found if x is not None]
    assert len(errors) == 8
    if law in ROBUST:
        assert max(errors) < 1e-4
    else:
        assert 1e-4 < min(errors) < 0.05


@pytest.mark.parametrize("law", ROBUST)
@settings(max_examples=8)
@given(seed=st.integers(0, 100))
def test_robust_laws_keep_the_average_with_random_phases_late_and_repeated_messages(law: str, seed: int) -> None:
    """Asynchronous: in each step a random agent does a round and sends; a message is lost, repeated, or late by steps.

    3600 steps are 600 rounds for each of 6 agents, twice what the slowest array of these seeds needs.
    """
    graph = random_hexagonal(6, seed)
    values = values_of(graph, seed, 2)
    use, states, names = LAWS[law], started(law, graph, values), agents(graph)
    dice, drawn = stream(seed, "test", "dice"), iter(range(10**6))
    pending: list[tuple[int, int, str, str, NDArray[np.float64]]] = []
    for step in range(3600):
        source = names[int(dice.uniform(next(drawn)) * len(names))]
        states[source] = use.round(states[source])
        for target in graph[source]:
            for _ in range(int(dice.uniform(next(drawn)) * 3)):  # lost, once or twice
                due = step + int(dice.uniform(next(drawn)) * 12)
                pending.append((due, next(drawn), source, target, told(use, states[source], target)))
        for _, _, origin, target, vector in sorted(m for m in pending if m[0] <= step):
            states[target] = use.receive(states[target], origin, vector)
        pending = [message for message in pending if message[0] > step]
    assert error({name: use.value(state) for name, state in states.items()}, values) < 1e-6


@pytest.mark.parametrize("law", sorted(LAWS))
def test_float32_messages_cost_what_the_documentation_says(law: str) -> None:
    """Running sums after 300 rounds err by 300 · 2⁻²⁵ of the values times the number of neighbours, others far less.

    Metropolis rounds anew each round, by 2⁻²⁵ of values of norm 3: at most 300 of them at worst, in practice fewer.
    Push-sum rounds mass and weight anew, which is twice as much.
    """
    graph = random_hexagonal(8, 2)
    values = values_of(graph, 2)
    found = error(run(law, graph, values, 300, wire=np.float32), values)
    bounds = {
        "metropolis": 300 * 3 * 2.0**-25,
        "push-sum": 2 * 300 * 3 * 2.0**-25,
        "running-sum": 300 * 6 * 3 * 2.0**-25,
        "flow-updating": 6 * 10 * 2.0**-25,
    }
    assert 0.0 < found < bounds[law]


@pytest.mark.parametrize("law", ROBUST)
def test_robust_laws_follow_an_input_that_changes(law: str) -> None:
    """After new inputs and 300 more lossy rounds the average is that of the new ones."""
    graph = random_hexagonal(6, 1)
    old, new = values_of(graph, 1), values_of(graph, 2)
    use, states, lost = LAWS[law], started(law, graph, old), one_way_loss(1, 0.3)
    for k in range(320):
        if k == 20:
            states = {i: use.update(state, new[i]) for i, state in states.items()}
        messages = [(i, j, told(use, states[i], j)) for i in states for j in graph[i]]
        for i, j, vector in messages:
            if not lost(i, j, k):
                states[j] = use.receive(states[j], i, vector)
        states = {i: use.round(state) for i, state in states.items()}
    assert error({i: use.value(state) for i, state in states.items()}, new) < 1e-6


def test_averaging_moves_by_the_change_of_its_input() -> None:
    """Its value moves by the difference, at once."""
    use = LAWS["metropolis"]
    state = use.round(use.receive(use.start([1.0], {"2": 0.5}), "2", [3.0]))
    np.testing.assert_array_equal(use.value(use.update(state, [1.5])), [2.5])


@pytest.mark.parametrize("law", sorted(LAWS))
@given(order=st.permutations(["2", "10", "3", "1a", "1", "20", "b"]))
def test_a_round_does_not_depend_on_the_order_of_arrival(law: str, order: list[str]) -> None:
    """The same messages in another order, or neighbours named in another order, give the same bits."""
    use = LAWS[law]
    size = use.message_size(3)
    messages = {n: np.array([stream(1, "test", n).uniform(i) * 3**i for i in range(size)]) for n in sorted(order)}

    def after(sequence: list[str]) -> bytes:
        state = use.start([0.3, 0.1, 0.7], dict.fromkeys(sequence, 1 / 7))
        for name in sequence:
            state = use.receive(state, name, messages[name])
        state = use.round(use.round(state))
        return b"".join([use.value(state).tobytes(), *(told(use, state, name).tobytes() for name in sorted(order))])

    assert after(order) == after(sorted(order))


@pytest.mark.parametrize("law", sorted(LAWS))
def test_messages_have_the_stated_size_and_states_are_values(law: str) -> None:
    """Receiving, rounding and updating leave the earlier state as it was."""
    use = LAWS[law]
    state = use.start([1.0, 2.0], {"2": 0.3, "3": 0.3})
    message = told(use, state, "2")
    assert message.shape == (use.message_size(2),)
    before = (use.value(state).tobytes(), message.tobytes())
    use.update(use.round(use.receive(state, "2", np.full(use.message_size(2), 5.0))), [0.0, 0.0])
    assert (use.value(state).tobytes(), told(use, state, "2").tobytes()) == before


@pytest.mark.parametrize("law", sorted(LAWS))
def test_strangers_and_damaged_messages_are_refused(law: str) -> None:
    """The message names the sender."""
    use = LAWS[law]
    state = use.start([1.0, 2.0], {"2": 0.3})
    good = np.ones(use.message_size(2))
    with pytest.raises(BadInput, match="'7' is not a neighbour"):
        use.receive(state, "7", good)
    with pytest.raises(BadInput, match="'7' is not a neighbour"):
        told(use, state, "7")
    for bad in (good[1:], np.append(good[1:], np.nan)):
        with pytest.raises(BadInput, match="message from 2"):
            use.receive(state, "2", bad)
    with pytest.raises(BadInput, match="value"):
        use.update(state, [1.0])


@pytest.mark.parametrize("law", sorted(LAWS))
def test_a_message_is_used_once(law: str) -> None:
    """A second round, in which nothing was heard, changes nothing."""
    use = LAWS[law]
    state, other = use.start([0.0], {"2": 0.5}), use.start([1.0], {"1": 0.5})
    once = use.round(use.receive(state, "2", told(use, other, "1")))
    assert use.value(once) == pytest.approx([0.5])
    np.testing.assert_array_equal(use.value(use.round(once)), use.value(once))


def test_running_sum_passes_over_a_message_that_comes_after_a_later_one() -> None:
    """Late or repeated, it changes nothing."""
    use = LAWS["running-sum"]
    other = use.start([1.0], {"1": 0.5})
    early = told(use, other, "1")
    late = told(use, use.round(use.receive(other, "1", [0.0, 0.5])), "1")
    state = use.receive(use.start([0.0], {"2": 0.5}), "2", late)
    for stale in (early, late):
        assert use.receive(state, "2", stale) is state


def test_an_agent_that_is_cut_off_keeps_its_mass() -> None:
    """Without news it gives nothing more away, however many rounds pass, and its estimate stays its value."""
    state = running_sum_start([2.0], ["2", "3"])
    for _ in range(2000):
        state = running_sum_round(state)
    np.testing.assert_array_equal(LAWS["running-sum"].value(state), [2.0])
    assert state.mass[-1] == pytest.approx(1 / 3)
