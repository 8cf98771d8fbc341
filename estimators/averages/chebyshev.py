"""Averaging accelerated by Chebyshev polynomials: each round combines the results of the last two rounds.

Golub and Varga 1961, the Chebyshev semi-iterative method; for average consensus Montijano, Montijano and Sagüés 2013.
With W symmetric weights that keep the average, whose other eigenvalues lie within [−ρ, ρ]:

    x(k+1) = ω(k+1) (W x(k) − x(k−1)) + x(k−1),    ω(1) = 1,  ω(2) = 2 / (2 − ρ²),  ω(k+1) = 4 / (4 − ρ² ω(k))

After k rounds the disagreement has shrunk at least by the factor 1 / T_k(1/ρ), T_k being the Chebyshev polynomial;
plain averaging has ρᵏ. Each round relies on the one before: a lost message does more harm than in plain averaging.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ..checks import as_array
from .averaging import Averaging, averaging_message, averaging_receive, averaging_round, averaging_start
from .laws import ConsensusLaw


@dataclass(frozen=True, eq=False)
class Chebyshev:
    """State of one agent: that of weighted averaging, the value of the previous round, and ω of the next round."""

    averaging: Averaging
    before: NDArray[np.float64]
    omega: float


def chebyshev_law(contraction: float) -> ConsensusLaw[Chebyshev]:
    """The consensus law for weights with the essential spectral radius ρ, in (0, 1).

    Raises:
        BadInput: ρ is out of bounds.
    """
    _check(contraction)

    def start(value: ArrayLike, weights: Mapping[str, float]) -> Chebyshev:
        begun = averaging_start(value, weights)
        return Chebyshev(begun, begun.value, 1.0)

    def end_round(state: Chebyshev) -> Chebyshev:
        averaged = averaging_round(state.averaging)
        value = state.omega * (averaged.value - state.before) + state.before
        first = state.omega == 1.0
        omega = 2.0 / (2.0 - contraction**2) if first else 4.0 / (4.0 - contraction**2 * state.omega)
        return Chebyshev(replace(averaged, value=value), state.averaging.value, omega)

    return ConsensusLaw(
        start,
        lambda state, to: averaging_message(state.averaging, to),
        lambda state, sender, vector: replace(state, averaging=averaging_receive(state.averaging, sender, vector)),
        end_round,
        lambda state: state.averaging.value,
        _update,
        lambda size: size,
    )


def _update(state: Chebyshev, value: ArrayLike) -> Chebyshev:
    """Replace the own input: the values of both rounds change by the difference, so that the average follows."""
    old = state.averaging
    source = as_array(value, old.source.shape, "value")
    change = source - old.source
    return replace(state, averaging=replace(old, source=source, value=old.value + change), before=state.before + change)


def _check(contraction: float) -> None:
    if not 0.0 < contraction < 1.0:
        raise BadInput(f"contraction is {contraction:g}, it must lie between 0 and 1: that of the weights in use")
