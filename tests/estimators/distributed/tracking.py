"""A target of constant velocity, agents that see one coordinate of it or nothing, and filters without a transport."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from volery.estimators.averages.average_consensus import average_consensus
from volery.estimators.distributed.filtering import Filter, Moment, Place
from volery.estimators.distributed.filters import choose_filter
from volery.estimators.distributed.gaussian import Gaussian, Measurement, Step, corrected, measured_information, predict
from volery.randomness import stream
from volery.topologies import agents, natural_key

Lost = Callable[[str, str, int], bool]
PERIOD_S = 0.5
STEP = Step(
    np.array([[1, 0, PERIOD_S, 0], [0, 1, 0, PERIOD_S], [0, 0, 1, 0], [0, 0, 0, 1]]),
    0.5 * np.kron([[PERIOD_S**3 / 3, PERIOD_S**2 / 2], [PERIOD_S**2 / 2, PERIOD_S]], np.eye(2)).astype(np.float64),
    np.zeros(4),
)
PRIOR = Gaussian(np.zeros(4), np.diag([100.0, 100.0, 4.0, 4.0]))
NOISE_M = 2.0
REMEMBERED = 8


def whole(_source: str, _target: str, _number: int) -> bool:
    """No message is lost."""
    return False


def bernoulli(seed: int, probability: float) -> Lost:
    """Independent loss in all directions."""
    return lambda source, target, number: stream(seed, "test loss", source, target).uniform(number) < probability


def one_way(seed: int, probability: float) -> Lost:
    """Loss from the lower to the higher name only."""
    both = bernoulli(seed, probability)
    return lambda source, target, number: natural_key(source) < natural_key(target) and both(source, target, number)


@dataclass(frozen=True)
class Truth:
    """A target's path and what the agents saw of it: agent k sees x, y, or nothing, by k modulo 3."""

    states: NDArray[np.float64]
    measurements: tuple[Mapping[str, Measurement | None], ...]
    centralised: tuple[Gaussian, ...]


def path(names: tuple[str, ...], samples: int, normal: Iterator[float]) -> Truth:
    """Path, measurements, and the centralised Kalman filter on them, from standard normal draws."""
    state = np.array([next(normal) for _ in range(4)]) * np.sqrt(np.diag(PRIOR.covariance))
    factor, belief = np.linalg.cholesky(STEP.noise), PRIOR
    states, seen, beliefs = [], [], []
    for sample in range(samples):
        if sample:
            state = STEP.transition @ state + factor @ [next(normal) for _ in range(4)]
            belief = predict(belief, STEP)
        measured: dict[str, Measurement | None] = dict.fromkeys(names)
        for number, name in enumerate(names):
            if number % 3 < 2:
                row = np.eye(4)[[number % 3]]
                measured[name] = Measurement(row, np.eye(1) * NOISE_M**2, row @ state + NOISE_M * next(normal))
        belief = corrected(belief, [measured_information(one, 4) for one in measured.values()])
        states.append(state)
        seen.append(measured)
        beliefs.append(belief)
    return Truth(np.array(states), tuple(seen), tuple(beliefs))


@lru_cache(maxsize=64)
def truth(names: tuple[str, ...], seed: int, samples: int) -> Truth:
    """The path of a seed."""
    return path(names, samples, map(stream(seed, "test", "target").normal, count()))


def track(
    name: str,
    graph: nx.Graph,
    *,
    rounds: int = 3,
    samples: int = 40,
    seed: int = 1,
    lost: Lost = whole,
    late: Callable[[int], int] = lambda _number: 0,
    seen: Truth | None = None,
    **options: float,
) -> dict[str, list[Gaussian]]:
    """Agent → its belief at each sample; a message is late by so many whole samples."""
    names = tuple(agents(graph))
    choice = choose_filter(name, options)
    parts = average_consensus(choice.averaging, graph, seed)
    filters = {who: choice.make(Place(who, names, rounds, parts[who].law), PRIOR) for who in names}
    seen = seen or truth(names, seed, samples)
    found: dict[str, list[Gaussian]] = {who: [] for who in names}
    air: list[tuple[int, int, str, str, NDArray[np.float64]]] = []
    for sample in range(samples):
        steps = (STEP,) * min(sample, REMEMBERED)
        for who, one in filters.items():
            one.begin(Moment(sample, seen.measurements[sample][who], steps, parts[who].weights))
        for number in range(sample * rounds, (sample + 1) * rounds):
            for who, one in filters.items():
                for other in graph[who]:
                    vector = one.message(other)
                    if vector is not None and not lost(who, other, number):
                        air.append((number + late(number) * rounds, sample, who, other, vector))
            here = [each for each in air if each[0] <= number]
            air = [each for each in air if each[0] > number]
            for who, one in filters.items():
                one.hear(_received(one, who, sample, here))
        for who, one in filters.items():
            found[who].append(one.end())
    return found


def _received(
    one: Filter, who: str, sample: int, here: list[tuple[int, int, str, str, NDArray[np.float64]]]
) -> dict[str, NDArray[np.float64]]:
    received = {}
    for _, sent, source, target, vector in here:
        if target == who:
            now = vector if sent == sample else one.forward(vector, sample - sent)
            if now is not None:
                received[source] = now
    return received


def anees(found: Mapping[str, list[Gaussian]], states: NDArray[np.float64], skip: int = 0) -> float:
    """Mean NEES over agents and samples, over the dimension: 1 of a consistent filter."""
    values = []
    for beliefs in found.values():
        for belief, state in list(zip(beliefs, states, strict=True))[skip:]:
            apart = belief.mean - state
            values.append(apart @ np.linalg.solve(belief.covariance, apart) / len(state))
    return float(np.mean(values))


def overconfidence(name: str, graph: nx.Graph, *, samples: int, **how: Any) -> float:
    """Largest ratio, over agents, samples and directions, of the variance of the error to the one that is claimed.

    A filter whose gains do not hang on the measurements makes errors that are linear in the noises. So one run for each
    noise alone, set to one, gives the columns G of e = G n, and the covariance G Gᵀ of the error exactly.
    """
    names = tuple(agents(graph))
    noises = 4 * samples + sum(number % 3 < 2 for number in range(len(names))) * samples
    runs = []
    for chosen in range(noises):
        seen = path(names, samples, (float(number == chosen) for number in count()))
        runs.append((seen.states, track(name, graph, samples=samples, seen=seen, **how)))
    worst = 0.0
    for who in names:
        for sample in range(samples):
            G = np.array([found[who][sample].mean - states[sample] for states, found in runs]).T
            factor = np.linalg.cholesky(runs[0][1][who][sample].covariance)
            worst = max(worst, float(np.linalg.norm(np.linalg.solve(factor, G), 2)) ** 2)
    return worst
