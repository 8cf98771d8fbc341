"""Ways to average by name: how fast they converge, against what theory predicts, and what gossip does with messages."""

from __future__ import annotations

import math
from itertools import islice
from typing import Any

import networkx as nx
import numpy as np
import pytest

from volery import topologies
from volery.errors import BadInput
from volery.estimators.averages.average_consensus import AVERAGINGS, average_consensus, predicted_contraction
from volery.estimators.averages.chebyshev import chebyshev_law
from volery.estimators.averages.gossip import gossip_law
from volery.estimators.averages.laws import ConsensusLaw
from volery.estimators.averages.synchronous import synchronous_rounds
from volery.estimators.error_measures import contraction
from volery.randomness import stream
from volery.topologies import agents, complete, geometric, natural_key, ring, star, weight_matrix


def disagreements(name: str, graph: nx.Graph, rounds: int, lost: float = 0.0) -> list[float]:
    """Distance of all values to the true average after each round; loss is one-way."""
    draws = stream(7, "test", "values")
    values = {who: np.array([draws.normal(3 * k + i) for i in range(3)]) for k, who in enumerate(agents(graph))}
    average = np.mean(list(values.values()), axis=0)

    def gone(i: str, j: str, number: int) -> bool:
        return natural_key(i) < natural_key(j) and stream(3, "test loss", i, j).uniform(number) < lost

    held = synchronous_rounds(average_consensus(name, graph, 5), graph, values, gone)
    return [float(np.linalg.norm([value - average for value in now.values()])) for now in islice(held, rounds)]


GRAPHS = {"ring": ring(8), "star": star(8), "geometric": geometric(8, 0.5, 4)}


@pytest.mark.parametrize("graph", GRAPHS.values(), ids=GRAPHS)
@pytest.mark.parametrize("name", ["metropolis", "constant-edge", "maximum-degree", "fastest-mixing"])
def test_averaging_contracts_as_the_spectrum_predicts(name: str, graph: nx.Graph) -> None:
    """Rounds 40 to 60, where the slowest mode is what is left: within 1 % of the essential spectral radius."""
    rule = getattr(topologies, name.replace("-", "_"))
    predicted = predicted_contraction(average_consensus(name, graph), graph)
    assert contraction(disagreements(name, graph, 60)[40:]) == pytest.approx(predicted, rel=0.01)
    if name != "constant-edge":
        assert predicted == pytest.approx(topologies.contraction(weight_matrix(graph, rule(graph))), abs=1e-6)


@pytest.mark.parametrize("graph", GRAPHS.values(), ids=GRAPHS)
def test_chebyshev_keeps_its_bound_and_beats_plain_averaging(graph: nx.Graph) -> None:
    """At most 1 / T_k(1/ρ) = 1 / cosh(k arcosh(1/ρ)) of the first is left; after 25 a fifth of Metropolis's."""
    rho = topologies.contraction(weight_matrix(graph, topologies.metropolis(graph)))
    found = disagreements("chebyshev", graph, 25)
    for k, value in enumerate(found, start=1):
        assert value <= _spread(graph) / math.cosh(k * math.acosh(1.0 / rho)) + 1e-12
    assert found[-1] < 0.2 * disagreements("metropolis", graph, 25)[-1]


def _spread(graph: nx.Graph) -> float:
    draws = stream(7, "test", "values")
    values = np.array([[draws.normal(3 * k + i) for i in range(3)] for k in range(len(graph))])
    return float(np.linalg.norm(values - values.mean(axis=0)))


@pytest.mark.parametrize("name", sorted(AVERAGINGS))
def test_without_loss_every_way_reaches_the_average(name: str) -> None:
    """Gossip, the slowest, is at 1e-9 after 400 rounds on this graph."""
    found = disagreements(name, GRAPHS["geometric"], 400)
    assert found[-1] < 1e-8


@pytest.mark.parametrize("name", sorted(AVERAGINGS))
def test_under_one_way_loss_only_running_sum_and_flow_updating_reach_the_average(name: str) -> None:
    """30 % of one direction, 400 rounds: they are at rounding, every other way is off by at least a hundredth."""
    found = disagreements(name, GRAPHS["geometric"], 400, lost=0.3)
    if name in ("running-sum", "flow-updating"):
        assert found[-1] < 1e-6
    else:
        assert found[-1] > 0.01


def test_gossip_talks_to_one_neighbour_and_pairs_take_their_mean() -> None:
    """Of the messages of a round each agent sends one; where two have chosen each other both hold the mean."""
    graph = complete(5)
    names = agents(graph)
    laws = {who: gossip_law(who, 3) for who in names}
    states = {who: laws[who].start([float(who)], dict.fromkeys(graph[who], 0.2)) for who in names}
    chosen = {i: [j for j in graph[i] if laws[i].message(states[i], j) is not None] for i in names}
    assert all(len(partners) == 1 for partners in chosen.values())
    for i, (j,) in chosen.items():
        message = laws[i].message(states[i], j)
        assert message is not None
        states[j] = laws[j].receive(states[j], i, message)
    pairs = [(i, j) for i, (j,) in chosen.items() if chosen[j] == [i]]
    assert pairs
    after = {who: laws[who].value(laws[who].round(state))[0] for who, state in states.items()}
    for i in names:
        partner = dict(pairs).get(i)
        assert after[i] == (float(i) if partner is None else (float(i) + float(partner)) / 2)


def test_gossip_and_chebyshev_follow_a_changed_input() -> None:
    """The value moves by the difference."""
    laws: tuple[ConsensusLaw[Any], ...] = (gossip_law("1", 0), chebyshev_law(0.5))
    for law in laws:
        state: Any = law.start([1.0], {"2": 0.5})
        state = law.update(law.round(state), [3.0])
        assert law.value(state) == pytest.approx([3.0])


def test_bad_input_is_refused() -> None:
    """With the bound."""
    with pytest.raises(BadInput, match="averaging 'mean' is not known: use metropolis"):
        average_consensus("mean", ring(3))
    for rho in (0.0, 1.0):
        with pytest.raises(BadInput, match="must lie between 0 and 1"):
            chebyshev_law(rho)
    state = gossip_law("1", 0).start([1.0], {"2": 0.5})
    with pytest.raises(BadInput, match="'7' is not a neighbour"):
        gossip_law("1", 0).message(state, "7")
