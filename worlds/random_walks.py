"""Random walks as pure functions of seed and time."""

from __future__ import annotations

from functools import lru_cache

from ..randomness import stream

_STEP_NS = 1_000_000_000
_KEPT = 256


def walk(seed: int, purpose: str, agent: str, time_ns: int) -> float:
    """Value at an instant ≥ 0 of a random walk with unit variance per second; 0 at 0, and linear within seconds.

    Dimensionless per √s: multiply by the strength of a walk, as in m/√s.
    """
    step, rest_ns = divmod(time_ns, _STEP_NS)
    knots = _knots(seed, purpose, agent)
    return knots.at(step) + (knots.at(step + 1) - knots.at(step)) * rest_ns / _STEP_NS


class _Knots:
    """Values at whole seconds, summed on demand."""

    def __init__(self, seed: int, purpose: str, agent: str) -> None:
        self._draws = stream(seed, purpose, agent)
        self._values = [0.0]

    def at(self, second: int) -> float:
        while len(self._values) <= second:
            self._values.append(self._values[-1] + self._draws.normal(len(self._values)))
        return self._values[second]


@lru_cache(maxsize=_KEPT)
def _knots(seed: int, purpose: str, agent: str) -> _Knots:
    return _Knots(seed, purpose, agent)
