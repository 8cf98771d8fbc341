"""What a vehicle's estimate of its formation says of where all of them are: for pictures in plan view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...quantities import Floats
from .evaluation import View


def formation_view(names: Sequence[str], state: Floats, covariance: Floats | None) -> View:
    """All places about their centre, which the estimate does not know, and their covariances about it.

    p_i = c_i − Σ_m c_m / N with c_1 = 0, c_{i+1} = c_i − r_i            Nägeli 2014, (4): r_i = p_i − p_{i+1}

    Args:
        names: of the N vehicles, in natural order.
        state: r_1, ṙ_1, r_2, …, (6(N − 1),) [m, m/s].
        covariance: of the state, of (6(N − 1))² numbers, if it is known.
    """
    count = len(names)
    chain = -np.tri(count, count - 1, -1)
    centred = chain - chain.mean(axis=0)
    places = centred @ state.reshape(count - 1, 6)[:, :2]
    covariances = {}
    if covariance is not None:
        flat = covariance.reshape(count - 1, 6, count - 1, 6)[:, :2, :, :2]
        covariances = {
            name: np.einsum("m,manb,n->ab", row, flat, row) for name, row in zip(names, centred, strict=True)
        }
    return View(dict(zip(names, places, strict=True)), covariances, relative=True)
