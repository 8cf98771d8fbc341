"""Which sensors are to be trusted: those whose readings go on being near what is predicted of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import BadInput

RETURN = 0.7
"""A sensor that was put aside is trusted again where its mean square comes below this share of the bound, squared."""


@dataclass(frozen=True)
class Trust:
    """How a sensor's residuals were of late: their mean square, forgetting exponentially, and whether it is trusted."""

    mean_square: float = 0.0
    trusted: bool = True


def judged(before: Trust, residual: float, bound: float, share: float) -> Trust:
    """The trust in a sensor after one more residual.

    s⁺ = s + share (e² − s); it is lost where s⁺ > bound² and comes back where s⁺ < (0.7 bound)²

    The gap between the two keeps a sensor at the bound from being put aside and taken back again and again. A residual
    of many times the bound loses trust at once, one that grows slowly when its root mean square reaches the bound.

    Args:
        before: as it was.
        residual: difference e of reading and prediction, in the unit of the bound.
        bound: the largest root mean square of a sensor that works, above 0.
        share: weight of the newest residual, above 0 and at most 1: time between two of them over the time to forget.
    Raises:
        BadInput: a bound or share out of its bounds, or a residual that is not finite.
    """
    if not (bound > 0.0 and 0.0 < share <= 1.0 and math.isfinite(residual)):
        raise BadInput(f"residual {residual:g}, bound {bound:g}, share {share:g}: give finite, above 0, in (0, 1]")
    mean_square = before.mean_square + share * (residual * residual - before.mean_square)
    limit = bound if before.trusted else RETURN * bound
    return Trust(mean_square, mean_square <= limit * limit)
