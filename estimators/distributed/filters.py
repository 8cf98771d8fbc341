"""Filters by name: built-in filters, and `package.module:Class` for a user's own.

A name may be followed by an averaging method, as in `consensus-on-measurements/running-sum`; the default is Metropolis
averaging.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from ...errors import BadInput
from ...names import did_you_mean, imported_class
from ..averages.average_consensus import AVERAGINGS
from .consensus_filters import (
    ConsensusOnInformation,
    ConsensusOnMeasurements,
    Hybrid,
    HybridContributions,
    InformationWeighted,
)
from .covariance_intersection import CovarianceIntersection
from .diffusion import DiffusionFilter
from .event_triggered import EventTriggered
from .filtering import Filter, LocalFilter, Place
from .gaussian import Gaussian
from .kalman_consensus import KalmanConsensus2007, KalmanConsensus2009

FILTERS: Mapping[str, type[Filter]] = MappingProxyType(
    {
        "local": LocalFilter,
        "kalman-consensus-2007": KalmanConsensus2007,
        "kalman-consensus-2009": KalmanConsensus2009,
        "diffusion": DiffusionFilter,
        "consensus-on-measurements": ConsensusOnMeasurements,
        "consensus-on-information": ConsensusOnInformation,
        "hybrid": Hybrid,
        "hybrid-contributions": HybridContributions,
        "information-weighted": InformationWeighted,
        "covariance-intersection": CovarianceIntersection,
        "event-triggered": EventTriggered,
    }
)


@dataclass(frozen=True)
class FilterChoice:
    """A class of filter, its averaging method, and its options."""

    kind: type[Filter]
    averaging: str
    options: Mapping[str, float]

    def make(self, place: Place, prior: Gaussian) -> Filter:
        """Create the filter of one agent.

        Raises:
            BadInput: an option is out of bounds.
        """
        return self.kind(place, prior, **self.options)


def choose_filter(name: str, options: Mapping[str, float] | None = None) -> FilterChoice:
    """The choice that a name such as `hybrid`, `hybrid/chebyshev` or `my_module:MyFilter` stands for.

    Args:
        name: the filter, optionally with an averaging method.
        options: keyword arguments of the filter's class.
    Raises:
        BadInput: no such filter, averaging method or option; the message lists those that exist.
    """
    first, slash, averaging = name.partition("/")
    if slash and averaging not in AVERAGINGS:
        raise BadInput(f"filter {name!r}: averaging {averaging!r} is not known: use {', '.join(AVERAGINGS)}")
    kind = _find(first)
    known = [one.name for one in inspect.signature(kind).parameters.values() if one.kind is one.KEYWORD_ONLY]
    given = dict(options or {})
    for option in given:
        if option not in known:
            raise BadInput(f"filter {first} has no option {option!r}: it has {', '.join(known) or 'none'}")
    return FilterChoice(kind, averaging or AVERAGINGS[0], given)


@cache
def _find(name: str) -> type[Filter]:
    if name in FILTERS:
        return FILTERS[name]
    if ":" not in name:
        raise BadInput(f"filter {name!r} is not known{did_you_mean(name, FILTERS)}, or write package.module:Class")
    return imported_class(name, Filter, f"filter {name!r}")
