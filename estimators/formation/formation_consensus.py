"""The consensus Kalman filter of a formation: each vehicle has a filter, and uses messages as measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...units import check_fields_above_zero
from .covariance import check_positive
from .filter import FormationFilter, Observation
from .formation_messages import FullMessage, History, Message, PairMessage, run_forward
from .intersection import Weighting, intersect
from .model import check_pair

Delay = Literal["ignore", "compensate"]
Fusion = Literal["kalman", "intersection"]
_Stream = tuple[int, tuple[tuple[int, int], ...]]


@dataclass(frozen=True)
class ConsensusSettings:
    """How messages are used.

    delay: `compensate` propagates them from their time stamps to now, `ignore` uses them as if they were current.
    fusion: `kalman` assumes errors independent of the own ones, as Nägeli 2014 does; `intersection` does not.
    weighting: of covariance intersection.
    position_noise: standard deviation for messages without a covariance, per axis [m].
    velocity_noise: likewise [m/s].
    history_ns: largest age of a message that can be propagated [ns].
    """

    delay: Delay = "compensate"
    fusion: Fusion = "kalman"
    weighting: Weighting = "optimal"
    position_noise: float = 0.01
    velocity_noise: float = 0.05
    history_ns: int = 1_000_000_000

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "position_noise", "velocity_noise", "history_ns")

    def noise(self, count: int) -> NDArray[np.float64]:
        """Covariance N of a message on this many pairs, shape (6 count, 6 count) [m², m²/s²], read only."""
        return _noise(self, count)


@lru_cache(maxsize=64)
def _noise(settings: ConsensusSettings, count: int) -> NDArray[np.float64]:
    variances = np.repeat([settings.position_noise**2, settings.velocity_noise**2], 3)
    noise = np.diag(np.tile(variances, count))
    noise.setflags(write=False)
    return noise


@dataclass
class MessageCounts:
    """Numbers of received messages by how they were used.

    folded: used in an update.
    superseded: not used, as there was a newer one of the same sender on the same pairs.
    too_old: not used, as its stamp is before the history of forces.
    ahead: not used, as its stamp is later than now by more than the length of the history.
    useless: not used, as it would have increased the covariance (intersection only).
    """

    folded: int = 0
    superseded: int = 0
    too_old: int = 0
    ahead: int = 0
    useless: int = 0


@dataclass
class ConsensusFilter:
    """State machine of one vehicle: predict, receive, update, send.

    x̂ⁱ⁺ = x̂ⁱ + L_i (z_i − C_i x̂ⁱ) + F_i Σ_j (t_ij − H_j x̂ⁱ), with [L_i F_i] the gain of both together.
    A message has the covariance N, or the one that it contains. With the raw measurements of all vehicles and the true
    forces this is the centralised filter. Messages, however, depend on the sender's measurements *and* on earlier
    messages: `kalman` counts the same information several times, so that the covariance is too small; `intersection`
    does not.

    own: the filter; `own.state` and `own.covariance` are the vehicle's estimate.
    settings: how messages are used.
    """

    own: FormationFilter
    settings: ConsensusSettings = field(default_factory=ConsensusSettings)
    message_counts: MessageCounts = field(default_factory=MessageCounts, init=False)

    def __post_init__(self) -> None:
        """Start without messages."""
        self._history = History(self.own.model, self.own.time_ns, self.settings.history_ns)
        self._waiting: list[Message] = []
        self._newest: dict[_Stream, int] = {}

    def predict(self, time_ns: int, forces: ArrayLike) -> None:
        """Predict to a later instant with forces, shape (N, 3) or (3N,) [N], that are constant until then.

        The forces are u = −K (x̂ⁱ − x_ref) by the own estimate for all vehicles, the own force as commanded.

        Raises:
            BadInput: as `FormationFilter.predict`; nothing is changed then.
        """
        self.own.predict(time_ns, forces)
        self._history.record(time_ns, np.asarray(forces, dtype=np.float64).reshape(-1, 3))

    def receive(self, message: Message) -> None:
        """Store a message, to be used in the next update that is not before its stamp.

        Raises:
            BadInput: vehicles or lengths do not fit the formation, or intersection needs a covariance that is missing.
        """
        for pair in message.pairs:
            check_pair(self.own.model.vehicles, pair)
        if len(message.values) != 6 * len(message.pairs):
            raise BadInput(f"a message of {len(message.values)} values on {len(message.pairs)} pairs: give 6 for each")
        if isinstance(message, FullMessage) and len(message.values) != self.own.model.size:
            raise BadInput(
                f"a whole estimate of {len(message.values)} values: this formation has {self.own.model.size}"
            )
        if self.settings.fusion == "intersection" and message.covariance is None:
            raise BadInput("covariance intersection needs messages with a covariance or a bound of it: send one along")
        if message.covariance is not None:
            check_positive(message.covariance, f"covariance of a message of {message.sender}")
        self._waiting.append(message)

    def update(self, sightings: Sequence[Observation]) -> None:
        """Update with the own camera's present observations and the received messages.

        With `intersection` the observations come first, then each message separately.

        Raises:
            BadInput: as `FormationFilter.update`.
        """
        told = [self._observation(message) for message in self._due()]
        if self.settings.fusion == "kalman":
            self.own.update([*sightings, *told])
            self.message_counts.folded += len(told)
            return
        self.own.update(sightings)
        for each in told:
            used = intersect(self.own, each, self.settings.weighting) < 1.0
            self.message_counts.folded += used
            self.message_counts.useless += not used

    def pair_message(
        self, sender: int, seen: int, *, unseen_ns: int = 0, attitude: NDArray[np.float64] | None = None
    ) -> PairMessage:
        """Message on the tracked pair: H x̂ⁱ and its covariance, which a codec may leave out."""
        values, covariance = self.own.pair(sender, seen)
        return PairMessage(sender, seen, self.own.time_ns, values, unseen_ns, attitude, covariance)

    def full_message(self, sender: int) -> FullMessage:
        """Message on all pairs: x̂ⁱ and its covariance, which a codec may leave out."""
        return FullMessage(sender, self.own.time_ns, self.own.state, self.own.covariance)

    def _due(self) -> list[Message]:
        """Messages to use now: for each sender and pair the newest that is not stamped later, or the last received."""
        arrived, self._waiting = self._waiting, []
        newest: dict[_Stream, Message] = {}
        stamped = self.settings.delay == "compensate"
        for message in arrived:
            if stamped and not self._in_time(message):
                continue
            key = message.sender, message.pairs
            self.message_counts.superseded += key in newest
            newest[key] = message
            self._newest[key] = message.time_ns
        return list(newest.values())

    def _in_time(self, message: Message) -> bool:
        """Whether a message can be propagated now; one stamped later than now waits, unless it is too far ahead."""
        ahead_ns = message.time_ns - self.own.time_ns
        if ahead_ns > self.settings.history_ns:
            self.message_counts.ahead += 1
        elif ahead_ns > 0:
            self._waiting.append(message)
        elif message.time_ns < self._history.oldest_ns:
            self.message_counts.too_old += 1
        elif message.time_ns <= self._newest.get((message.sender, message.pairs), message.time_ns - 1):
            self.message_counts.superseded += 1
        else:
            return True
        return False

    def _observation(self, message: Message) -> Observation:
        noise = self.settings.noise(len(message.pairs)) if message.covariance is None else message.covariance
        if self.settings.delay == "ignore":
            return Observation(message.pairs, message.values, noise)
        return run_forward(self.own.model, self._history, message, noise)
