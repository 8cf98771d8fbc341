"""The result of an evaluation, and its file: all that tables and figures need besides the record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ...agents.plan_codec import decode_value, encode_value
from ...errors import BadInput
from ...quantities import Component, Floats, Role
from ...transport.faults import LinkName
from ..whole_files import whole_file
from .comparisons import Channel
from .evaluation import Finding

Whole = NDArray[np.int64]
VERSION = 2
_ABOUT = "about"
_NO_COVARIANCES = np.zeros((0, 0, 2, 2))
_NEVER = np.zeros(0, dtype=bool)


@dataclass(frozen=True)
class EvaluatedQuantity:
    """One reported quantity of k components, whose differences have m.

    T rows, one a sample or instant, say which of the reports stand side by side: `time_ns` and `index` (T,), `rows`
    agent → (T,), −1 where it has none. For each report of an agent: `truth`, `central` (n, k), and the differences of
    the report to both, (n, m), of which there are none where values are subtracted; NaN where not known.
    `disagreement` (T,): root mean square distance of the agents to their mean, as seen from the first that has an
    estimate; NaN where each has its own. Where covariances were reported, else without agents: `deviation` (n, m), the
    standard deviations that they state, `nees` (n,) of the reports, or NIS of innovations, and `central_nees` (n,).
    """

    components: tuple[Component, ...]
    difference_components: tuple[Component, ...]
    role: Role
    is_shared: bool
    time_ns: Whole
    index: Whole
    rows: Mapping[str, Whole]
    truth: Mapping[str, Floats]
    central: Mapping[str, Floats]
    truth_difference: Mapping[str, Floats]
    central_difference: Mapping[str, Floats]
    disagreement: Floats
    deviation: Mapping[str, Floats]
    nees: Mapping[str, Floats]
    central_nees: Mapping[str, Floats]


@dataclass(frozen=True)
class Places:
    """Where something is, or is believed to be, from each of T instants on: `places` (T, M, 2) [m] of M `names`.

    NaN where nothing is known. `covariances` (T, M, 2, 2) [m²], or empty. `relative` (T,): all may be shifted alike.
    """

    names: tuple[str, ...]
    time_ns: Whole
    places: Floats
    covariances: Floats = field(default_factory=lambda: _NO_COVARIANCES)
    relative: NDArray[np.bool_] = field(default_factory=lambda: _NEVER)

    def row(self, time_ns: int) -> int:
        """The row that holds at an instant, −1 before the first."""
        return int(np.searchsorted(self.time_ns, time_ns, side="right")) - 1


@dataclass(frozen=True)
class EvaluationResult:
    """Quantities in alphabetical order, findings, and places: true ones of agents, believed ones, those of others.

    `places` is None where agents have none. `views`: agent → where it believes whom to be. `followed`: what is no
    agent, at its true place. `channels`: what links with models of users' own were asked and got.
    """

    quantities: Mapping[str, EvaluatedQuantity]
    findings: tuple[Finding, ...] = ()
    places: Places | None = None
    views: Mapping[str, Places] = field(default_factory=dict)
    followed: Places | None = None
    channels: Mapping[LinkName, Channel] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"EvaluationResult of {', '.join(self.quantities) or 'no estimates'}; {len(self.findings)} findings"

    def quantity(self, name: str) -> EvaluatedQuantity:
        """One of the quantities.

        Raises:
            BadInput: nobody reported it.
        """
        if name not in self.quantities:
            raise BadInput(f"nobody reported {name!r}; this run has {', '.join(self.quantities) or 'no estimates'}")
        return self.quantities[name]

    def compared(self) -> tuple[str, ...]:
        """The quantities that are estimates."""
        return tuple(name for name, quantity in self.quantities.items() if quantity.role == "estimate")

    def tested(self) -> tuple[str, ...]:
        """The estimates and innovations of which covariances were reported."""
        return tuple(name for name, quantity in self.quantities.items() if quantity.nees)


def save_evaluation(result: EvaluationResult, path: Path) -> None:
    """Write an evaluation to a file, whole or not at all."""
    parts: dict[str, NDArray[np.uint8]] = {}

    def store(data: bytes) -> str:
        name = str(len(parts))
        parts[name] = np.frombuffer(data, np.uint8)
        return name

    about = json.dumps({"version": VERSION, "result": encode_value(result, store)})
    parts[_ABOUT] = np.frombuffer(about.encode(), np.uint8)
    with whole_file(path) as partial:
        np.savez_compressed(partial, allow_pickle=False, **parts)


def load_evaluation(path: Path) -> EvaluationResult | None:
    """The evaluation that was written to a file; None where there is none.

    Raises:
        BadInput: it is damaged, or of another version.
    """
    try:
        with path.open("rb") as opened, np.load(opened) as file:
            about = json.loads(file[_ABOUT].tobytes())
            if about["version"] != VERSION:
                raise BadInput(f"{path} is of another version of volery: `volery evaluate` makes it again")
            result: EvaluationResult = decode_value(about["result"], lambda name: file[name].tobytes(), only_read=True)
            return result
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise BadInput(f"{path} is damaged ({error}): `volery evaluate` makes it again") from error
