"""Parameters of vehicles in a formation, and what follows from them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...estimators.formation.assignment import assignment, occlusions
from ...estimators.formation.control import Weights
from ...estimators.formation.filter import LONGEST_STEP_NS, Form, FormationFilter
from ...estimators.formation.formation_consensus import ConsensusSettings, Delay, Fusion
from ...estimators.formation.intersection import Weighting
from ...estimators.formation.model import FormationModel
from ...topologies.formations import Formation
from ...units import (
    Bounds,
    Bytes,
    Hertz,
    Kilograms,
    Metres,
    MetresPerSecondSquared,
    Nanoseconds,
    Radians,
    RadiansPerSecond,
    Unit,
    period_ns,
)
from ..idle import refuse_idle
from ..payloads import Precision
from .mav_messages import CovarianceContent, Kind, Layout

_DEGREE = math.pi / 180
_INITIAL_SPREAD = (0.3, 0.3)
"""Standard deviations of the first estimate, in metres and metres per second."""


@dataclass(frozen=True)
class Leg:
    """A reference and the instant from which it holds."""

    at: Nanoseconds
    reference: str


@dataclass(frozen=True)
class Filtering:
    """How a vehicle estimates the formation; see `estimators.formation.formation_consensus`."""

    delay: Delay = "compensate"
    fusion: Fusion = "kalman"
    weighting: Weighting = "optimal"
    form: Form = "joseph"
    acceleration_noise: MetresPerSecondSquared = 2.0
    camera_noise: Metres = 0.02
    message_noise: Metres = 0.01
    history: Nanoseconds = 1_000_000_000

    def __post_init__(self) -> None:
        """Check what the filter does not check."""
        if not 0 < self.camera_noise < math.inf:
            raise BadInput(f"camera_noise is {self.camera_noise:g} m, it must be above 0")
        if self.delay == "ignore":
            because = "delay is ignore, which runs no message forward: leave it out, or write delay: compensate"
            refuse_idle(self, ("history",), because, "filtering.")
        if self.fusion == "kalman":
            because = "fusion is kalman, which weighs nothing: leave it out, or write fusion: intersection"
            refuse_idle(self, ("weighting",), because, "filtering.")
        if self.fusion == "intersection":
            because = "fusion is intersection, which takes the covariance that messages bear: leave it out"
            refuse_idle(self, ("message_noise",), because, "filtering.")

    def settings(self) -> ConsensusSettings:
        """Settings of the consensus filter; communication noise is five times as large for velocities."""
        return ConsensusSettings(
            self.delay, self.fusion, self.weighting, self.message_noise, 5.0 * self.message_noise, self.history
        )


@dataclass(frozen=True)
class Messages:
    """Contents of a packet; see `agents.mav.mav_messages`."""

    kind: Kind = "pair"
    precision: Precision = "float32"
    attitude: bool = True
    covariance: CovarianceContent = "none"
    packet: Bytes = 50

    def layout(self, vehicles: int) -> Layout:
        """Layout for a number of vehicles."""
        return Layout(self.kind, vehicles, self.precision, self.attitude, self.covariance)


@dataclass(frozen=True)
class Frames:
    """How vehicles estimate and agree on the inertial frame; see `estimators.frames.frame_consensus`.

    `consensus` false: each vehicle keeps its own. `noise`: of the own attitude, added to that of a sighting.
    `upright`: standard deviation of the initial tilt; a vehicle that restarts in flight has no estimate of it.
    """

    consensus: bool = True
    step: float = 0.3
    anchor: float = 0.02
    noise: Radians = _DEGREE
    upright: Radians = _DEGREE

    def __post_init__(self) -> None:
        """Check that all values have an effect."""
        if not self.consensus:
            because = "consensus is false, so no frame moves towards another: leave it out, or write consensus: true"
            refuse_idle(self, ("step", "anchor"), because, "frames.")


@dataclass(frozen=True)
class MavParameters:
    """A vehicle of a formation.

    `references`: name → formation, as in `topologies.formations`; `script`: which of them holds from which instant on;
    before, the first one. `rate`: of camera and filter, `radio`: of the messages, at a `phase` drawn from the seed or
    aligned. `tracks`: vehicle → the one it keeps in view, by default an assignment that makes the formation observable
    within `camera_range`, not hidden by vehicles of this `radius`. `patience`: a vehicle that has neither seen nor
    received anything for so long stops regulating. `silence`: a vehicle is left out of the formation while the others
    send as many messages as in this time and it sends none. `report`: rate of the estimate, and `report_covariance` of
    its covariance, 0 for none.
    """

    references: Mapping[str, Formation]
    script: tuple[Leg, ...] = ()
    rate: Hertz = 30.0
    radio: Hertz = 5.0
    phase: Literal["drawn", "aligned"] = "drawn"
    mass: Kilograms = 0.45
    weights: Weights = Weights()  # noqa: RUF009 - frozen
    filtering: Filtering = Filtering()
    messages: Messages = Messages()
    frames: Frames = Frames()
    tracks: Mapping[str, str | int] | None = None
    camera_range: Metres = 5.0
    radius: Metres = 0.2
    yaw_gain: float = 3.0
    yaw_integral: float = 0.5
    yaw_rate: RadiansPerSecond = 2.0
    patience: Nanoseconds = 1_000_000_000
    silence: Nanoseconds = 3_000_000_000
    report: Hertz = 30.0
    report_covariance: Annotated[float, Unit("Hz"), Bounds(least=0.0)] = 0.0

    def __post_init__(self) -> None:
        """Check what does not depend on the number of vehicles."""
        for name in ("rate", "radio", "report"):
            if not 0 < getattr(self, name) < math.inf:
                raise BadInput(f"{name} is {getattr(self, name):g} Hz, it must be above 0")
        if not 0 < self.yaw_rate < math.inf:
            raise BadInput(f"yaw_rate is {self.yaw_rate:g} rad/s, it must be above 0")
        if not 0 <= self.report_covariance < math.inf:
            raise BadInput(f"report_covariance is {self.report_covariance:g} Hz, it must be at least 0")
        if period_ns(self.rate, 1) > LONGEST_STEP_NS:
            most = LONGEST_STEP_NS / 1e6
            raise BadInput(
                f"rate is {self.rate:g} Hz: a step longer than {most:g} ms is more than the prediction allows"
            )
        if not self.references:
            raise BadInput("references is empty: write one, as in {A: {triangle: 0.9 m}}")
        for leg in self.script:
            if leg.reference not in self.references:
                known = ", ".join(self.references)
                raise BadInput(f"script names reference {leg.reference!r}, and there is {known}")
        if any(late.at <= early.at for early, late in zip(self.script, self.script[1:], strict=False)):
            raise BadInput("script goes back in time: write its legs in the order of their instants")

    def reference_at(self, time_ns: int) -> str:
        """Name of the reference that holds at an instant."""
        reached = bisect_right([leg.at for leg in self.script], time_ns)
        return self.script[reached - 1].reference if reached else next(iter(self.references))

    def places(self, name: str, vehicles: int) -> NDArray[np.float64]:
        """Positions of the vehicles in a reference, about their centroid, (N, 3) [m].

        Raises:
            BadInput: the reference does not fit so many vehicles.
        """
        try:
            return self.references[name].of(vehicles)
        except BadInput as error:
            raise BadInput(f"references.{'.'.join(map(str, (name, *error.place)))}: {error}") from error

    def states(self, vehicles: int) -> dict[str, NDArray[np.float64]]:
        """Reference → state of the formation at rest in it, (6(N−1),)."""
        model = self.model(vehicles)
        return {name: model.reference(self.places(name, vehicles)) for name in self.references}

    def tracked(self, names: tuple[str, ...], gone: Collection[int] = ()) -> dict[int, int]:
        """Vehicle → the one that it tracks, by index among the names.

        Vehicles follow `tracks` as long as all tracked ones are there; else they are assigned again. Where no
        assignment of the rest is observable, each tracks the nearest.

        Args:
            names: of all vehicles.
            gone: vehicles that are left out; they track nobody.
        Raises:
            BadInput: a vehicle tracks itself or an unknown one or none, or no assignment of all is observable.
        """
        given = {} if self.tracks is None else self._given_tracks(names)
        living = [number for number in range(len(names)) if number not in gone]
        if given and not set(gone) & set(given.values()):
            return {number: given[number] for number in living}
        if len(living) < 2:
            return {}
        places = self.places(self.reference_at(0), len(names))[living]
        hidden = occlusions(places, self.radius)
        try:
            found = assignment(places, self.camera_range, hidden, [names[number] for number in living])
        except BadInput:
            if not gone:
                raise
            distances = np.linalg.norm(places[:, np.newaxis] - places, axis=-1) + np.diag(np.full(len(living), np.inf))
            found = tuple(distances.argmin(axis=1).tolist())
        return {number: living[seen] for number, seen in zip(living, found, strict=True)}

    def in_sight(self, names: tuple[str, ...], gone: Collection[int] = ()) -> list[tuple[int, int]]:
        """Pairs of `tracked`, observer first, that are in view in the first reference; those left out hide nobody.

        Arguments and errors are those of `tracked`.
        """
        places = self.places(self.reference_at(0), len(names))
        living = [number for number in range(len(names)) if number not in gone]
        hidden = {(living[i], living[j]) for i, j in occlusions(places[living], self.radius)}
        return [
            (i, j)
            for i, j in self.tracked(names, gone).items()
            if math.dist(places[i], places[j]) <= self.camera_range and (i, j) not in hidden
        ]

    def _given_tracks(self, names: tuple[str, ...]) -> dict[int, int]:
        assert self.tracks is not None
        given = {name: str(seen) for name, seen in self.tracks.items()}
        for name in names:
            if given.get(name, name) == name or given[name] not in names:
                seen = given.get(name, "nobody")
                raise BadInput(f"tracks: vehicle {name} tracks {seen}: name another vehicle of {', '.join(names)}")
        return {number: names.index(given[name]) for number, name in enumerate(names)}

    def filter(self, vehicles: int, time_ns: int = 0) -> FormationFilter:
        """Filter that starts at rest in the reference of an instant."""
        reference = self.states(vehicles)[self.reference_at(time_ns)]
        form = self.filtering.form
        return FormationFilter(self.model(vehicles), reference, _INITIAL_SPREAD, time_ns=time_ns, form=form)

    def model(self, vehicles: int) -> FormationModel:
        """Dynamics and noise over one period of the camera."""
        return FormationModel(vehicles, period_ns(self.rate, 1), self.mass, self.filtering.acceleration_noise)
