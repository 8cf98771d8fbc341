"""A sweep before it runs: its cells as scenarios, its seeds, and what its results rest on.

Cells that share a seed share every random decision that is asked of both, whatever else differs (common random
numbers): repetition r of each cell has the seed of the scenario plus r.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...agents.loaded_sources import cells_text
from ...agents.plan import Plan
from ...agents.plan_codec import encode_plan
from ...agents.registry import find
from ...errors import BadInput, RunFailed
from ...transport.faults import LinkFault
from ...transport.media_settings import HalfDuplex
from ..evaluation.evaluation import evaluation_class
from ..execution import Engine
from ..record.machine import fingerprint
from ..scenario.compile import compile_plan
from ..scenario.load import LoadedScenario, load_scenario, resolved_yaml
from ..scenario.paces import check_pace
from ..scenario.validate import validate_plan
from ..scenario.yaml_document import NOTHING
from .axes import Axis, Over, axis_of, grid, random_cells, read_axis, spanned

Pairing = Literal["channel", "channel, half-duplex apart", "frame by frame"]
"""Whether cells with one seed meet the same links: as functions of time; that, but for what a half-duplex or shared
medium does, which depends on who sends when; or only as long as they send frame for frame the same."""
_PACKAGE = Path(__file__).parents[2]
_NOT_OF_RESULTS = _PACKAGE / "experiments" / "cli"
"""What shows results and makes none."""
_IMPORT_STRING = re.compile(r"([A-Za-z_][\w.]*):[A-Za-z_]")
_DIGITS = 16
_MADE_WITH = ("python", "numpy", "scipy", "blas", "simd")


class SweptAxis(NamedTuple):
    """An axis as results have it: its name, the labels of its points, and their numbers in `unit` if they have any."""

    name: str
    labels: tuple[str, ...]
    numbers: tuple[float, ...] | None
    unit: str

    def value(self, label: str) -> float | str:
        """What stands in the table for a point."""
        return label if self.numbers is None else self.numbers[self.labels.index(label)]


class SweptCell(NamedTuple):
    """A cell as results have it: the label of its point on each axis, its resolved scenario, and its pairing."""

    labels: tuple[str, ...]
    scenario: str
    pairing: Pairing


Done = Callable[[int, int], bool]
"""Whether a cell's repetition need not be run."""


class Job(NamedTuple):
    """One run: which cell and repetition, its plan as `plan_codec` encodes it, and all else that a worker needs."""

    cell: int
    repeat: int
    seed: int
    plan: str
    scenario: str
    engine: Engine
    paths: tuple[str, ...]
    keep: str | None


@dataclass(frozen=True)
class SweepPlan:
    """A sweep as data. `made_with`: versions, and hashes of code, graphs and traces, on which bits depend.

    `loaded`: the scenario and plan of each cell, where the sweep is to be carried out and not only read again.
    """

    name: str
    seed: int
    engine: Engine
    axes: tuple[SweptAxis, ...]
    cells: tuple[SweptCell, ...]
    made_with: Mapping[str, Any]
    loaded: tuple[LoadedScenario, ...] = field(default=(), repr=False, compare=False)

    def __repr__(self) -> str:
        return f"SweepPlan {self.name}: {', '.join(axis.name for axis in self.axes)}; {len(self.cells)} cells"

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the scenario is not in the plans of its cells, a sentence each."""
        return tuple(dict.fromkeys(note for one in self.loaded for note in one.notes))

    @property
    def digest(self) -> str:
        """What tells this sweep from others; the number of repetitions is not in it, so that more can be added."""
        return hashlib.sha256(json.dumps(self.to_json(), sort_keys=True).encode()).hexdigest()[:16]

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        axes, cells = [axis._asdict() for axis in self.axes], [cell._asdict() for cell in self.cells]
        own = {name: value for name, value in vars(self).items() if name != "loaded"}
        plain: dict[str, Any] = json.loads(json.dumps({**own, "axes": axes, "cells": cells}))
        return plain

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> SweepPlan:
        """What `to_json` gave."""
        axes = tuple(
            SweptAxis(
                axis["name"],
                tuple(axis["labels"]),
                None if axis["numbers"] is None else tuple(axis["numbers"]),
                axis["unit"],
            )
            for axis in plain["axes"]
        )
        cells = tuple(SweptCell(tuple(cell["labels"]), cell["scenario"], cell["pairing"]) for cell in plain["cells"])
        return cls(plain["name"], plain["seed"], plain["engine"], axes, cells, plain["made_with"])

    def jobs(self, repeat: int, paths: Sequence[str], keep: Path | None, done: Done) -> Iterator[Job]:
        """The runs that are not done: all cells of the first repetition, then those of the next.

        Raises:
            RunFailed: a cell cannot be with this seed; the message names both.
        """
        for number, (index, one) in product(range(repeat), enumerate(self.loaded)):
            if done(index, number):
                continue
            seed = self.seed + number
            place = None if keep is None else str(keep / f"{index}-{number}")
            try:
                read = _seeded(one, seed)
            except BadInput as error:
                raise RunFailed(f"cell {index}, seed {seed}: {error}") from error
            plan, text = encode_plan(read.plan), resolved_yaml(read.scenario)
            yield Job(index, number, seed, plan, text, self.engine, tuple(paths), place)


def plan_sweep(
    scenario: str | Path | Mapping[str, Any],
    overrides: Sequence[str] = (),
    over: Sequence[str] | Over = (),
    random: int | None = None,
    engine: Engine = "twin",
    given: Mapping[str, Any] = NOTHING,
) -> SweepPlan:
    """The sweep of a scenario over ranges; every cell is validated.

    Args:
        scenario: as for `volery.run`.
        overrides: what is set in all cells.
        over: `KEY=RANGE` words, or a mapping, see `axes`.
        random: so many random cells instead of the grid.
        engine: of all runs; Zenoh runs in lockstep pace.
        given: fields from Python that replace those of the scenario.
    Raises:
        BadInput: a key that does not exist, an empty range, a cell that cannot be; the message names the cell.
    """
    axes = _axes(over)
    base = load_scenario(scenario, overrides, given).plan
    cells = grid(axes) if random is None else random_cells(axes, random, base.seed)
    modules: set[str] = set()
    swept, loaded = [], []
    for cell in cells:
        labels = tuple(point.label for point in cell.points)
        try:
            one = _valid(load_scenario(scenario, [*overrides, *cell.overrides], given))
        except BadInput as error:
            raise BadInput(_of_cell(str(error), axes, labels)) from error
        text = resolved_yaml(one.scenario)
        kinds = {agent.kind for agent in one.plan.agents}
        modules |= {code.__module__ for kind in kinds for code in (find(kind), evaluation_class(kind))}
        modules |= set(_IMPORT_STRING.findall(text))
        swept.append(SweptCell(labels, text, pairing(one.plan)))
        loaded.append(one)
    of_axes = tuple(map(_swept_axis, spanned(axes, cells)))
    files = _hash(sorted({file for one in loaded for file in one.files}))
    made = {**made_with(modules), "files": files}
    return SweepPlan(base.name, base.seed, engine, of_axes, tuple(swept), made, tuple(loaded))


def _axes(over: Sequence[str] | Over) -> list[Axis]:
    if isinstance(over, Mapping):
        axes = [read_axis(name, written) for name, written in over.items()]
    else:
        axes = [axis_of(word) for word in over]
    names = [axis.name for axis in axes]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise BadInput(f"--over {twice} occurs twice: write all its values in one list")
    return axes


def _swept_axis(axis: Axis) -> SweptAxis:
    labels = tuple(point.label for point in axis.points)
    if axis.numbers is None:
        return SweptAxis(axis.name, labels, None, "")
    numbers, unit = axis.numbers
    return SweptAxis(axis.name, labels, tuple(numbers), unit)


def _valid(read: LoadedScenario) -> LoadedScenario:
    """A scenario, if it can be run.

    Raises:
        BadInput: it asks for too much, or for what only realtime pace has.
    """
    validate_plan(read.plan, read.scenario.overload)
    check_pace({settings.medium for settings in read.plan.links.values()}, read.plan.faults, realtime=False)
    return read


def _seeded(read: LoadedScenario, seed: int) -> LoadedScenario:
    """The same with another seed."""
    if seed == read.scenario.seed:
        return read
    scenario = replace(read.scenario, seed=seed)
    return LoadedScenario(scenario, compile_plan(scenario))


def _of_cell(message: str, axes: Sequence[Axis], labels: Sequence[str]) -> str:
    """An error of a cell: what `--set` would be blamed for came from `--over`; other errors name the cell."""
    named = message
    for axis in axes:
        named = named.replace(f"--set {axis.name}:", f"--over {axis.name}:")
    if named != message or not axes:
        return named
    where = ", ".join(f"{axis.name}={label}" for axis, label in zip(axes, labels, strict=True))
    return f"with {where}: {message}"


def pairing(plan: Plan) -> Pairing:
    """How far cells with one seed meet the same links."""
    changes = [fault.changes for fault in plan.faults if isinstance(fault, LinkFault)]
    slots = [settings.paired for settings in plan.links.values()] + [
        change["paired"] for change in changes if "paired" in change
    ]
    media = [settings.medium for settings in plan.links.values()] + [
        change["medium"] for change in changes if "medium" in change
    ]
    if None in slots:
        return "frame by frame"
    shared = any(isinstance(medium, HalfDuplex) for medium in media)
    return "channel, half-duplex apart" if shared else "channel"


def made_with(modules: Iterable[str] = ()) -> dict[str, Any]:
    """What the bits of results depend on besides their scenarios: versions, and hashes of the code.

    `modules`: names; a file is hashed for each that is loaded and none of ours, as for a user's agents and filters.
    """
    here = fingerprint()
    ours = __package__.partition(".")[0]
    foreign = sorted(name for name in modules if name in sys.modules and name.partition(".")[0] != ours)
    hashes = {name: _source_hash(name) for name in foreign}
    return {**{name: here[name] for name in _MADE_WITH}, "code": _code(), "modules": hashes}


@cache
def _code() -> str:
    """A hash of every module that a result can depend on: all but those of the command line."""
    folders = [folder.resolve() for folder in sorted(_PACKAGE.iterdir()) if folder.is_dir()]
    paths = [*sorted(_PACKAGE.glob("*.py")), *(path for folder in folders for path in sorted(folder.rglob("*.py")))]
    return _hash(path for path in paths if _NOT_OF_RESULTS.resolve() not in path.parents)


def _source_hash(module: str) -> str:
    """Of a module's file or a notebook's cells; of code without a text, as of standard input, always another."""
    file = Path(getattr(sys.modules[module], "__file__", ""))
    if file.is_file():
        return _hash([file])
    return hashlib.sha256(cells_text().encode() or os.urandom(_DIGITS)).hexdigest()[:_DIGITS]


def _hash(paths: Iterable[Path]) -> str:
    found = hashlib.sha256()
    for path in paths:
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:_DIGITS]
