"""What agents estimate: how it is declared, by a world or an evaluation, for tables, figures and consistency tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from .errors import BadInput

Floats = NDArray[np.float64]
Role = Literal["estimate", "innovation", "diagnostic"]
"""An estimate has a truth, and errors; an innovation should be zero on average; a diagnostic is recorded, no more."""
_COVARIANCE = "/covariance"


class Component(NamedTuple):
    """One component of a quantity: name, unit for people, and factor from the stored value to that unit."""

    name: str
    unit: str = ""
    factor: float = 1.0


class Difference(Protocol):
    """By how much estimates (…, k) are off from a reference (…, k): (…, m), whose two-norm is the error."""

    def __call__(self, estimate: Floats, reference: Floats, /) -> Floats:
        """NaN stays NaN."""


def subtracted(estimate: Floats, reference: Floats) -> Floats:
    """The difference of vectors."""
    with np.errstate(invalid="ignore"):  # of two that have diverged to infinity there is no difference
        return np.asarray(estimate - reference)


def covariance_name(quantity: str) -> str:
    """The name under which `context.report` writes down the covariance that it is given with a value."""
    return quantity + _COVARIANCE


@dataclass(frozen=True)
class Quantity:
    """What agents report under one name.

    name: as in `context.report`.
    components: in their order; () to number them.
    role: an estimate, an innovation or a diagnostic.
    is_shared: whether all agents estimate one and the same thing, so that they can disagree, or each has its own.
    difference: of an estimate from a reference, for what is no vector, such as attitudes.
    difference_components: those of a difference, if they are others.
    covariance: the quantity that holds the covariance of the difference, all of it or its upper triangle by rows; by
        default the one that `context.report` writes when it is given a covariance.
    """

    name: str
    components: Sequence[Component] = ()
    role: Role = "estimate"
    is_shared: bool = True
    difference: Difference = subtracted
    difference_components: Sequence[Component] | None = None
    covariance: str | None = None

    def __post_init__(self) -> None:
        """Check what is declared.

        Raises:
            BadInput: no such role, or components that are none.
        """
        if self.role not in get_args(Role):
            roles = ", ".join(get_args(Role))
            raise BadInput(f"quantity {self.name!r}: role is {self.role!r}: it must be one of {roles}")
        for component in (*self.components, *(self.difference_components or ())):
            if not isinstance(component, Component):
                raise BadInput(
                    f"quantity {self.name!r}: {component!r} is no component: write Component({component!r}, unit)"
                )

    @property
    def is_place(self) -> bool:
        """Whether its first two components are x and y in metres: where something is, to be drawn in plan view."""
        return [(name, unit) for name, unit, _ in self.components[:2]] == [("x", "m"), ("y", "m")]

    @property
    def covariance_quantity(self) -> str:
        """The name under which its covariance is reported, if it is."""
        return self.covariance or covariance_name(self.name)


def check_quantities(quantities: Any) -> None:
    """Check what a class declares.

    Raises:
        BadInput: no list of quantities, or two of one name.
    """
    if not isinstance(quantities, Sequence) or not all(isinstance(one, Quantity) for one in quantities):
        raise BadInput(f"quantities is {quantities!r}: write a list, as in quantities = [Quantity(…)]")
    names = [one.name for one in quantities]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise BadInput(f"quantities has {twice!r} twice: declare it once")


def declared(name: str, quantities: Sequence[Quantity]) -> Quantity:
    """The quantity of a name: a diagnostic where it is the covariance of another, else a plain shared estimate."""
    for quantity in quantities:
        if quantity.name == name:
            return quantity
    is_covariance = name.endswith(_COVARIANCE) or any(quantity.covariance == name for quantity in quantities)
    return Quantity(name, role="diagnostic" if is_covariance else "estimate")
