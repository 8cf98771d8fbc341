"""How runs of a kind of agents are judged; nothing of it is known to the agents.

An agent's class names its evaluation class. One object of it is made for a finished run, fed with all that was sensed,
commanded and, if it asks, received, in the order of the events, and asked about each report.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...agents.agent import Received, Sample
from ...agents.plan import Plan
from ...agents.registry import find
from ...errors import BadInput
from ...estimators.error_measures import disagreement
from ...estimators.information import unpack_covariance
from ...names import imported_class, subclass
from ...overrides import check_overrides
from ...quantities import Floats, Quantity, check_quantities, declared
from ...transport.faults import Fault
from ...worlds.own_world import OwnWorld


class Series(NamedTuple):
    """What one agent reported of one quantity, in order.

    time_ns (n,) int64, nominal; sample (n,) int64, the index it was reported under; value (n, k) float64.
    """

    time_ns: NDArray[np.int64]
    sample: NDArray[np.int64]
    value: Floats


@dataclass(frozen=True)
class Finding:
    """A result of a run: a number in its unit, a sentence, or both."""

    name: str
    value: float = math.nan
    unit: str = ""
    text: str = ""

    def __post_init__(self) -> None:
        """Check its kinds of values.

        Raises:
            BadInput: a value that is no number, or words that are no text.
        """
        if not isinstance(self.value, Real):
            raise BadInput(f"finding {self.name!r}: value is {self.value!r}, and no number: words go into text=")
        if not all(isinstance(words, str) for words in (self.name, self.unit, self.text)):
            raise BadInput(f"finding {self.name!r}: name, unit and text must be texts")


@dataclass(frozen=True)
class View:
    """Where an agent believes agents, or what they follow, to be: for pictures in plan view.

    `places`: name → place, shape (2,) or more [m], of which the first two components are drawn. `covariances`: name →
    covariance of these two, shape (2, 2) [m²], where it is known. `relative`: all of them may be shifted alike.
    """

    places: Mapping[str, Floats]
    covariances: Mapping[str, Floats] = field(default_factory=dict)
    relative: bool = False

    def __post_init__(self) -> None:
        """Check its shapes.

        Raises:
            BadInput: a place with less than two components, or a covariance that is not 2 × 2.
        """
        for name, place in self.places.items():
            if np.ndim(place) != 1 or len(place) < 2:
                raise BadInput(f"view: the place of {name!r} has the shape {np.shape(place)}: give x and y in metres")
        for name, covariance in self.covariances.items():
            if np.shape(covariance) != (2, 2):
                shape = np.shape(covariance)
                raise BadInput(f"view: the covariance of {name!r} has the shape {shape}: give that of x and y, 2 × 2")


class RunData(Protocol):
    """A run whose reports have been compared with truth and central estimate."""

    @property
    def last_ns(self) -> int:
        """When it ended."""

    @property
    def faults_in_effect(self) -> Sequence[Fault]:
        """The faults that came about, in the order of their starts."""

    @property
    def world_reports(self) -> Mapping[str, Series]:
        """The true quantities that a coupled world wrote down."""

    @property
    def notes(self) -> Sequence[Mapping[str, Any]]:
        """What was noted: {"agent": …, "what": …, "time_ns": …, …}."""

    def quantities(self) -> Sequence[str]:
        """What agents reported."""

    def estimates(self, quantity: str) -> Mapping[str, Series]:
        """Agent → its reports of a quantity."""

    def truth(self, quantity: str) -> Mapping[str, Floats]:
        """Agent → what was true for each of its reports, (n, k), NaN where that is not known."""

    def central(self, quantity: str) -> Mapping[str, Floats]:
        """Agent → the central estimate for each of its reports, (n, k), NaN where there is none."""

    def nees(self, quantity: str) -> Mapping[str, Floats]:
        """Agent → NEES of each of its reports, or NIS of innovations, (n,), NaN where no covariance belongs to it."""

    def central_nees(self, quantity: str) -> Mapping[str, Floats]:
        """The same for the central estimates, with their covariances."""


class Evaluation:
    """Base of all evaluations: quantities are vectors of numbered components, nothing is known of their truth.

    `quantities` declares what is reported, as the world may; what nobody declares is a plain estimate. `needs_payloads`
    asks for the payloads of all delivered frames to be recorded, and given to `received`. `world_reports` is what a
    coupled world wrote down of the truth.
    """

    quantities: Sequence[Quantity] = ()
    needs_payloads: ClassVar[bool] = False

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        self.plan = plan
        self.world_reports = world_reports

    def declared(self, name: str) -> Quantity:
        """The quantity of a name, as declared here, else by the world; see `declared` in volery.quantities."""
        of_world = getattr(self.plan.world or self.plan.coupled, "quantities", ())
        return declared(name, (*self.quantities, *of_world))

    # -- the central estimator: one that has everything that all agents have ------------------------------------

    def sampled(self, agent: str, sample: Sample) -> None:
        """An agent's sensor has taken a sample, with the sensor faults in it, stamped in nominal time."""

    def commanded(self, agent: str, command: str, value: Floats, time_ns: int) -> None:
        """A command to a coupled world takes effect."""

    def received(self, agent: str, frame: Received) -> None:
        """A frame was delivered to an agent."""

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> ArrayLike | None:
        """The central estimate of what an agent reports; None where there is none.

        It has been fed everything up to the instant, which is `instant` of the report; instants ascend.
        """
        return None

    # -- reports --------------------------------------------------------------------------------------------------

    def instant(self, agent: str, quantity: str, index: int, time_ns: int) -> int:
        """The instant that a report made at `time_ns` is about.

        That of the truth of this index in a coupled world that writes it down, else that of the report itself.
        """
        found = self._world_row(agent, quantity, index)
        return time_ns if found is None else int(found[0].time_ns[found[1]])

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> ArrayLike | None:
        """The true value of what an agent reports, at the instant that the report is about; None if it is not known.

        By default what a coupled world wrote down under this index, as `QUANTITY@AGENT` or `QUANTITY`, or what a
        user's world says.
        """
        if (found := self._world_row(agent, quantity, index)) is not None:
            series, row = found
            written: Floats = series.value[row]
            return written
        world = self.plan.world
        return world.truth(agent, quantity, time_ns) if isinstance(world, OwnWorld) else None

    def _world_row(self, agent: str, quantity: str, index: int) -> tuple[Series, int] | None:
        for name in (f"{quantity}@{agent}", quantity):
            if (series := self.world_reports.get(name)) is not None:
                row = int(np.searchsorted(series.sample, index))
                return (series, row) if row < len(series.sample) and series.sample[row] == index else None
        return None

    # -- the run ----------------------------------------------------------------------------------------------------

    def view(self, agent: str, reports: Mapping[str, Floats]) -> View | None:
        """Where an agent believes agents to be, or what they follow, by its latest reports; None if it does not say.

        Given true values in the place of what was reported, it says where that is which they follow. By default
        estimates that are places are drawn: one of its own is where the agent is, a shared one is called by its name.
        """
        places, covariances = {}, {}
        for name, value in reports.items():
            quantity = self.declared(name)
            if quantity.role == "estimate" and quantity.is_place:
                whose = name if quantity.is_shared else agent
                places[whose] = value[:2]
                if (flat := reports.get(quantity.covariance_quantity)) is not None:
                    covariances[whose] = unpack_covariance(flat, len(value))[:2, :2]
        return View(places, covariances) if places else None

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Results of a run beyond the errors of each quantity."""
        return ()


def distance_to_mean(quantity: Quantity, estimates: Floats) -> Floats:
    """Disagreement of agents: root mean square distance to their mean, as seen from the first that has an estimate.

    Args:
        quantity: what they estimate.
        estimates: (…, N, k), rows of NaN for agents without one.
    Returns:
        Shape (…), NaN where each agent has its own.
    """
    if not quantity.is_shared:
        return np.full(estimates.shape[:-2], np.nan)
    first = np.argmin(np.isnan(estimates).any(axis=-1), axis=-1)
    reference = np.take_along_axis(estimates, first[..., np.newaxis, np.newaxis], axis=-2)
    return disagreement(quantity.difference(estimates, np.broadcast_to(reference, estimates.shape)))


def evaluation_class(kind: str) -> type[Evaluation]:
    """The evaluation class that a kind of agents names.

    Raises:
        BadInput: no such kind, module or class, not a subclass of Evaluation, methods that take other arguments, or
            quantities that are none.
    """
    named, what = find(kind).evaluation, f"evaluation of agent kind {kind!r}"
    found = imported_class(named, Evaluation, what) if isinstance(named, str) else subclass(named, Evaluation, what)
    check_overrides(found, Evaluation, what)
    if not isinstance(found.quantities, property):
        _check_quantities(found.quantities, what)
    return found


def _check_quantities(quantities: Any, what: str) -> None:
    try:
        check_quantities(quantities)
    except BadInput as error:
        raise BadInput(f"{what}: {error}") from error


def evaluations(plan: Plan, world_reports: Mapping[str, Series]) -> dict[str, Evaluation]:
    """Agent → the evaluation of its kind, one object a class.

    Raises:
        BadInput: as `evaluation_class`, or an object that does not call its base class.
    """
    made: dict[type[Evaluation], Evaluation] = {}
    found = {}
    for agent in plan.agents:
        judge = evaluation_class(agent.kind)
        if judge not in made:
            made[judge] = new = judge(plan, world_reports)
            what = f"evaluation {judge.__name__}"
            if not (hasattr(new, "plan") and hasattr(new, "world_reports")):
                raise BadInput(f"{what}: __init__ must call super().__init__(plan, world_reports)")
            _check_quantities(new.quantities, what)
        found[agent.name] = made[judge]
    return found
