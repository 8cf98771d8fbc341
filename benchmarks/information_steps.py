"""Consensus on information of ten nodes, sample by sample: with volery's filter, and with filterpy's per node."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from volery.estimators.averages.average_consensus import average_consensus
from volery.estimators.distributed.filtering import Moment, Place
from volery.estimators.distributed.filters import choose_filter
from volery.estimators.distributed.gaussian import Gaussian, Measurement, Step
from volery.topologies import agents, geometric
from volery.worlds.target.target_world import TargetWorld, process_noise, transition

_NODES, _ROUNDS, _PERIOD_S, _NOISE_M, _WANDER = 10, 3, 0.5, 2.0, 0.7
_WARM_UP = 20

GRAPH = geometric(_NODES, 0.5, 3)
NAMES = tuple(agents(GRAPH))
SEES = {name: "xy"[number % 3] for number, name in enumerate(NAMES) if number % 3 < 2}
WORLD = TargetWorld(SEES, 1, 1 / _PERIOD_S, _WANDER, _NOISE_M, 10.0, 2.0)
A, Q = transition(_PERIOD_S), process_noise(_PERIOD_S, _WANDER)
P0 = np.diag([100.0, 100.0, 4.0, 4.0])
PARTS = average_consensus("metropolis", GRAPH)


def measurements(samples: int) -> list[dict[str, np.ndarray]]:
    """What each node that sees something measures, a mapping for each sample."""
    found = []
    for sample in range(samples):
        values = {name: WORLD.measure(name, axis, sample) for name, axis in SEES.items()}
        found.append({name: value for name, value in values.items() if value is not None})
    return found


def own(samples: int) -> dict[str, object]:
    """Consensus on information by volery, a filter a node; microseconds a sample, and the means at last."""
    seen, step = measurements(samples), Step(A, Q, np.zeros(4))
    choice = choose_filter("consensus-on-information")
    filters = {n: choice.make(Place(n, NAMES, _ROUNDS, PARTS[n].law), Gaussian(np.zeros(4), P0)) for n in NAMES}
    rows = {n: np.eye(4)[["xy".index(axis)]] for n, axis in SEES.items()}
    R = np.eye(1) * _NOISE_M**2
    started = 0.0
    for sample in range(samples):
        if sample == _WARM_UP:
            started = time.process_time()
        for n, one in filters.items():
            z = seen[sample].get(n)
            measurement = None if z is None else Measurement(rows[n], R, z)
            one.begin(Moment(sample, measurement, (step,) * min(sample, 1), PARTS[n].weights))
        for _ in range(_ROUNDS):
            messages = {n: one.message(next(iter(PARTS[n].weights))) for n, one in filters.items()}
            for n, one in filters.items():
                one.hear({j: vector for j in PARTS[n].weights if (vector := messages[j]) is not None})
        beliefs = {n: one.end() for n, one in filters.items()}
    spent = time.process_time() - started
    return {"microseconds": 1e6 * spent / (samples - _WARM_UP), "means": [beliefs[n].mean.tolist() for n in NAMES]}


def filterpy(samples: int) -> dict[str, object]:
    """The same algebra with filterpy's InformationFilter for prediction and update, and averages in numpy."""
    from filterpy.kalman import InformationFilter

    seen = measurements(samples)
    filters = {}
    for n in NAMES:
        one = InformationFilter(dim_x=4, dim_z=1, compute_log_likelihood=False)
        one.F, one.Q, one.x = A, Q, np.zeros((4, 1))
        one.P_inv = np.linalg.inv(P0)
        one.R_inv = np.eye(1) / _NOISE_M**2
        if n in SEES:
            one.H = np.eye(4)[["xy".index(SEES[n])]]
        filters[n] = one
    beliefs, started = {}, 0.0
    for sample in range(samples):
        if sample == _WARM_UP:
            started = time.process_time()
        for n, one in filters.items():
            if sample:
                one.predict()
            one.update(seen[sample].get(n))
        P = {n: one.P_inv for n, one in filters.items()}
        q = {n: one.P_inv @ one.x for n, one in filters.items()}
        for _ in range(_ROUNDS):
            P, q = {n: _averaged(n, P) for n in NAMES}, {n: _averaged(n, q) for n in NAMES}
        for n, one in filters.items():
            one.P_inv, one.x = P[n], np.linalg.solve(P[n], q[n])
            beliefs[n] = one.x, np.linalg.inv(P[n])
    spent = time.process_time() - started
    return {"microseconds": 1e6 * spent / (samples - _WARM_UP), "means": [filters[n].x.ravel().tolist() for n in NAMES]}


def _averaged(n: str, held: Mapping[str, np.ndarray]) -> np.ndarray:
    weights = PARTS[n].weights
    average = (1.0 - sum(weights.values())) * held[n]
    for j, weight in weights.items():
        average = average + weight * held[j]
    return average
