"""Entries of a scenario's timeline of faults, or of a live fault."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from ...errors import BadInput
from ...units import Bounds, Duration, Nanoseconds, PartsPerBillion, Period, Probability, quantity
from .fault_places import Words
from .fault_processes import Every
from .link_schema import LinkChanges
from .partitions import PartitionWord
from .settings_reading import Check, Reader, alternatives

ACTIONS = ("cut", "hold", "partition", "set", "kill", "pause", "hog", "clock", "sensor")
TROUBLES = ("failed", "stuck", "bias", "noise", "spikes")
_DETAILS = {
    "keep_state": "kill",
    "share": "hog",
    "offset": "clock",
    "drift": "clock",
    "where": "set",
    **dict.fromkeys(TROUBLES, "sensor"),
}
"""Field → the only action that it belongs to."""


def _exactly_one(names: Iterable[str]) -> dict[str, Any]:
    """What JSON Schema demands of a mapping that must have exactly one of some fields."""
    return {"oneOf": [{"required": [name]} for name in names]}


def _read_size(value: Any) -> tuple[float, ...]:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or any(isinstance(number, bool) or not isinstance(number, int | float) for number in numbers):
        raise BadInput(f"{value!r} should be a number, or one for each component, in the unit of the sensor")
    return tuple(float(number) for number in numbers)


Size = Annotated[tuple[float, ...], Reader(_read_size, lambda: alternatives(float, list[float]), dump=list)]


@dataclass(frozen=True)
class Spikes:
    """Samples that are off by ±`size`, each with this probability.

    size: a number, or one for each component, in the unit of the sensor.
    probability: probability that a sample is off.
    """

    size: Size
    probability: Probability

    def __post_init__(self) -> None:
        """Check the bound."""
        if not 0 < self.probability <= 1:
            raise BadInput(f"probability is {self.probability:g}, it lies above 0 and is at most 1")


def _not_before_the_start(at_ns: int) -> int:
    if at_ns < 0:
        raise BadInput(f"{quantity(at_ns, 'ns')} is before the run: a fault starts at 0 or later")
    return at_ns


def _lasting(duration_ns: int) -> int:
    if duration_ns <= 0:
        raise BadInput(f"for is {quantity(duration_ns, 'ns')}: a fault lasts longer than 0")
    return duration_ns


def _true(value: bool) -> bool:
    if not value:
        raise BadInput("is false, which says nothing: leave it out")
    return value


def _share(value: float) -> float:
    if not 0 < value <= 1:
        raise BadInput(f"share is {value:g}, it must be above 0 and at most 1")
    return value


def _drift(drift_ppb: int) -> int:
    if drift_ppb <= -(10**9):
        raise BadInput(f"drift is {quantity(drift_ppb, 'ppb')}: a clock does not stand still or go back")
    return drift_ppb


_Start = Annotated[Duration, Check(_not_before_the_start)]
_Flag = Annotated[bool, Check(_true)]


@dataclass(frozen=True)
class FaultEntry:
    """One entry of a scenario's `faults:`.

    at: when it starts.
    every: a random process of failures and repairs, instead of `at`.
    from: when the random process begins.
    until: when it ends; by default it lasts to the end of the run.
    for: how long it lasts.
    cut: links over which nothing passes.
    hold: links on which frames wait until the fault ends.
    partition: halves, random, majority-ring, isolate 5, bridge 5, or groups of agents as in [[1, 2], rest].
    where: links on which `set` changes settings.
    set: new values of settings of links.
    kill: agents whose process is killed; they are restarted when the fault ends.
    keep_state: whether a killed agent is restarted with the state that it had.
    pause: agents that handle no events meanwhile.
    hog: agents whose processor is shared with another load.
    share: share of the processor that the load takes.
    clock: agents whose local clock is wrong.
    offset: by how much it is ahead.
    drift: by how much it is fast.
    sensor: sensors, as in 2.distance.
    failed: whether they give no samples.
    stuck: whether they repeat their last sample.
    bias: added to each sample, in its unit: a number, or one for each component.
    noise: standard deviation of what is added to each sample, likewise.
    spikes: outliers of some samples.
    """

    json_schema: ClassVar[Mapping[str, Any]] = {
        "allOf": [_exactly_one(ACTIONS), _exactly_one(("at", "every"))],
        "dependentRequired": {"set": ["where"], "from": ["every"], **{name: [of] for name, of in _DETAILS.items()}},
        "dependentSchemas": {
            "sensor": _exactly_one(TROUBLES),
            "clock": {"anyOf": [{"required": ["offset"]}, {"required": ["drift"]}]},
            "for": {"not": {"anyOf": [{"required": ["every"]}, {"required": ["until"]}]}},
        },
    }

    at: _Start | None = None
    every: Every | None = None
    from_: _Start | None = None
    until: Period | None = None
    for_: Annotated[Period, Check(_lasting)] | None = None
    cut: Words | None = None
    hold: Words | None = None
    partition: PartitionWord | None = None
    where: Words | None = None
    set_: LinkChanges | None = None
    kill: Words | None = None
    keep_state: _Flag | None = None
    pause: Words | None = None
    hog: Words | None = None
    share: Annotated[float, Check(_share), Bounds(above=0.0, most=1.0)] | None = None
    clock: Words | None = None
    offset: Nanoseconds | None = None
    drift: Annotated[PartsPerBillion, Check(_drift)] | None = None
    sensor: Words | None = None
    failed: _Flag | None = None
    stuck: _Flag | None = None
    bias: Size | None = None
    noise: Size | None = None
    spikes: Spikes | None = None

    def __post_init__(self) -> None:
        """Check that the entry is one fault with its own fields."""
        self._check_times()
        self._check_action()
        self._check_details()

    def _check_times(self) -> None:
        if self.until is not None:
            for name, start_ns in (("at", self.at), ("from", self.from_)):
                if start_ns is not None and self.until <= start_ns:
                    text = f"until is {quantity(self.until, 'ns')} and {name} {quantity(start_ns, 'ns')}"
                    raise BadInput(f"{text}: a fault ends after it starts", ("until",))
        if (self.at is None) == (self.every is None):
            raise BadInput("write when it starts, at: 3 s, or a random process, every: {mtbf: 5 s, mttr: 1 s}")
        if self.from_ is not None and self.every is None:
            raise BadInput("from belongs to every: the process begins there; one fault starts at some instant, at: 3 s")
        if self.every is not None and self.for_ is not None:
            raise BadInput("for does not go with every: the process lasts until: 9 s")
        if self.until is not None and self.for_ is not None:
            raise BadInput("write until or for, not both")

    def _check_action(self) -> None:
        actions = [name for name in ACTIONS if self.given(name) is not None]
        if len(actions) != 1:
            raise BadInput(f"a fault is exactly one of {', '.join(ACTIONS)}, not {' and '.join(actions) or 'none'}")
        (action,) = actions
        for detail, whose in _DETAILS.items():
            if self.given(detail) is not None and whose != action:
                raise BadInput(f"{detail} belongs to {whose} and says nothing of a {action}")

    def _check_details(self) -> None:
        if self.set_ is not None and self.where is None:
            raise BadInput("set and where belong together: where: 3-7, set: {loss: 0.5}")
        if self.set_ is not None and not self.set_:
            raise BadInput("set is empty: write for example set: {loss: 0.5}")
        if self.clock is not None and not self.offset and not self.drift:
            raise BadInput("a clock fault has an offset, a drift or both: offset: 20 ms, drift: 50 ppm")
        troubles = [name for name in TROUBLES if self.given(name) is not None]
        if self.sensor is not None and len(troubles) != 1:
            named = " and ".join(troubles) or "none"
            raise BadInput(f"a sensor fault is exactly one of {', '.join(TROUBLES)}, not {named}: bias: 0.01")

    def given(self, name: str) -> Any:
        """The value of a field by its name in a scenario; None if it is not given."""
        return getattr(self, f"{name}_" if name in ("set", "for", "from") else name)

    @property
    def start_ns(self) -> int:
        """Start of the fault or of the random process."""
        return (self.from_ or 0) if self.at is None else self.at

    @property
    def until_ns(self) -> int | None:
        """End of the fault or of the random process; None if it does not end."""
        return self.until if self.for_ is None else self.start_ns + self.for_

    @property
    def action(self) -> str:
        """The action of the entry, one of `ACTIONS`."""
        return next(name for name in ACTIONS if self.given(name) is not None)

    @property
    def place(self) -> str:
        """The name of the field with the places."""
        return "where" if self.action == "set" else self.action
