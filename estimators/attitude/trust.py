"""Fault detection of sensors: a sensor is trusted while its readings stay near their predictions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import BadInput

RETURN = 0.7
"""A sensor is trusted again when the root mean square of its residuals falls below this fraction of the bound."""


@dataclass(frozen=True)
class Trust:
    """Exponentially weighted mean square of a sensor's residuals, and whether the sensor is trusted."""

    mean_square: float = 0.0
    trusted: bool = True


def updated_trust(before: Trust, residual: float, bound: float, share: float) -> Trust:
    """Update the trust in a sensor with one residual.

    s⁺ = s + share (e² − s); trust is lost if s⁺ > bound² and regained if s⁺ < (0.7 bound)²

    The hysteresis prevents repeated switching near the bound. A residual of many times the bound loses trust at once, a
    slowly growing one when its root mean square reaches the bound.

    Args:
        before: the trust before.
        residual: difference e of reading and prediction, in the unit of the bound.
        bound: the largest root mean square of a working sensor, above 0.
        share: weight of the newest residual, in (0, 1]: time between two residuals over the forgetting time.
    Raises:
        BadInput: a bound or share out of its bounds, or a residual that is not finite.
    """
    if not (bound > 0.0 and 0.0 < share <= 1.0 and math.isfinite(residual)):
        raise BadInput(f"residual {residual:g}, bound {bound:g}, share {share:g}: give finite, above 0, in (0, 1]")
    mean_square = before.mean_square + share * (residual * residual - before.mean_square)
    limit = bound if before.trusted else RETURN * bound
    return Trust(mean_square, mean_square <= limit * limit)
