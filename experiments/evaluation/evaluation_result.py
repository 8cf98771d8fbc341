"""What an evaluation says of a run, and its file: all that tables and figures need besides the record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...quantities import Component, Floats, Role
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
    estimate.
    """

    components: tuple[Component, ...]
    difference_components: tuple[Component, ...]
    role: Role
    time_ns: Whole
    index: Whole
    rows: Mapping[str, Whole]
    truth: Mapping[str, Floats]
    central: Mapping[str, Floats]
    truth_difference: Mapping[str, Floats]
    central_difference: Mapping[str, Floats]
    disagreement: Floats


@dataclass(frozen=True)
class Places:
    """Where something is, or is believed to be, from each of T instants on: `places` (T, M, 2) [m] of M `names`.

    NaN where nothing is said. `covariances` (T, M, 2, 2) [m²], or empty. `relative` (T,): all may be shifted alike.
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
    agent, at its true place.
    """

    quantities: Mapping[str, EvaluatedQuantity]
    findings: tuple[Finding, ...] = ()
    places: Places | None = None
    views: Mapping[str, Places] = field(default_factory=dict)
    followed: Places | None = None

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


def save_evaluation(result: EvaluationResult, path: Path) -> None:
    """Write an evaluation to a file, whole or not at all."""
    arrays: list[NDArray[Any]] = []
    about = json.dumps({"version": VERSION, **_plain(result, arrays)})
    partial = path.with_suffix(".partial")
    named = {_ABOUT: np.array(about), **{str(number): array for number, array in enumerate(arrays)}}
    with partial.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **named)
    partial.replace(path)


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """Plain values, with {"array": number} for each array, which is appended to `arrays`.

    Arrays by name are one below the other in one array, where what they have in common takes no room when compressed.
    """
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, Mapping) and value and all(isinstance(item, np.ndarray) for item in value.values()):
        arrays.append(np.concatenate(list(value.values())))
        return {"array": len(arrays) - 1, "lengths": {key: len(item) for key, item in value.items()}}
    if isinstance(value, Mapping):
        return {key: _plain(item, arrays) for key, item in value.items()}
    if is_dataclass(value):
        return {key: _plain(item, arrays) for key, item in vars(value).items()}
    return [_plain(item, arrays) for item in value] if isinstance(value, tuple) else value


def load_evaluation(path: Path) -> EvaluationResult | None:
    """The evaluation that was written to a file; None where there is none.

    Raises:
        BadInput: it is damaged, or of another version.
    """
    try:
        with path.open("rb") as opened, np.load(opened) as file:
            about = json.loads(str(file[_ABOUT]))
            if about.pop("version") != VERSION:
                raise BadInput(f"{path} is of another version of volery: `volery evaluate` makes it anew")
            return _result(_filled(about, file))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise BadInput(f"{path} is damaged ({error}): `volery evaluate` makes it anew") from error


def _filled(value: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """The values that `_plain` was given, with tuples as lists and dataclasses as mappings."""
    if isinstance(value, dict):
        if isinstance(number := value.get("array"), int):
            array, lengths = arrays[str(number)], value.get("lengths")
            if lengths is None:
                return array
            return dict(zip(lengths, np.split(array, np.cumsum([*lengths.values()])[:-1]), strict=True))
        return {key: _filled(item, arrays) for key, item in value.items()}
    return [_filled(item, arrays) for item in value] if isinstance(value, list) else value


def _result(fields: dict[str, Any]) -> EvaluationResult:
    def places(of: dict[str, Any] | None) -> Places | None:
        return None if of is None else Places(**{**of, "names": tuple(of["names"])})

    def quantity(of: dict[str, Any]) -> EvaluatedQuantity:
        named = {name: tuple(Component(*one) for one in of[name]) for name in ("components", "difference_components")}
        return EvaluatedQuantity(**{**of, **named})

    return EvaluationResult(
        {name: quantity(of) for name, of in fields["quantities"].items()},
        tuple(Finding(**of) for of in fields["findings"]),
        places(fields["places"]),
        {name: view for name, of in fields["views"].items() if (view := places(of)) is not None},
        places(fields["followed"]),
    )
