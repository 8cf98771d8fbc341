"""The results of a sweep on disk: sweep.json says what it is, journal.jsonl has a line for each finished run.

A line is written whole, or it is no line: what a kill cut off is dropped when the sweep goes on. At the end all becomes
table.parquet, with one row for each run in the order of cell and repetition and nothing of the clock: it does not tell
how often a sweep was interrupted, or on how many processes it ran.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ..analysis.export import write_parquet
from ..record.encoding import dump, tag, untag
from ..record.run_files import SWEEP_FILE
from ..whole_files import write_whole
from .sweep_plan import SweepPlan, SweptCell
from .sweep_runs import Values

JOURNAL_FILE, TABLE_FILE, KEPT = "journal.jsonl", "table.parquet", "runs"


class Row(NamedTuple):
    """One finished run."""

    cell: int
    repeat: int
    seed: int
    values: Values


@dataclass(frozen=True, repr=False)
class Sweep:
    """The results of a sweep: its plan, how many repetitions were asked for, and the runs that are finished.

    `rows` in the order of cell and repetition.
    """

    folder: Path
    plan: SweepPlan
    repeat: int
    rows: tuple[Row, ...]

    def __repr__(self) -> str:
        axes = " × ".join(f"{len(axis.labels)} {axis.name}" for axis in self.plan.axes) or "one cell"
        runs = f"{len(self.rows)} of {len(self.plan.cells) * self.repeat} runs"
        return f"Sweep {self.plan.name}: {axes}, {runs}, {len(self.measures)} measures\nfolder {self.folder}"

    @property
    def missing(self) -> int:
        """How many runs are not finished."""
        return len(self.plan.cells) * self.repeat - len(self.rows)

    @cached_property
    def measures(self) -> tuple[str, ...]:
        """Names of what was measured, in alphabetical order."""
        return tuple(sorted({name for row in self.rows for name in row.values}))

    def values(self, measure: str) -> dict[int, dict[int, float]]:
        """Cell → seed → value of a measure, where it is defined.

        Raises:
            BadInput: nothing of this name was measured.
        """
        if measure not in self.measures:
            raise BadInput(f"nothing called {measure!r} was measured; this sweep has {', '.join(self.measures)}")
        found: dict[int, dict[int, float]] = {index: {} for index in range(len(self.plan.cells))}
        for row in self.rows:
            value = row.values.get(measure)
            if value is not None:
                found[row.cell][row.seed] = value
        return found

    @cached_property
    def table(self) -> dict[str, NDArray[Any]]:
        """Column → its values, one a run: cell, the axes, repeat, seed, pairing, and each measure, else NaN."""
        kinds = columns(self)
        rows = list(table_rows(self))
        return {
            name: np.array(
                [row[place] for row in rows], dtype={"VARCHAR": np.str_, "BIGINT": np.int64}.get(kind, float)
            )
            for place, (name, kind) in enumerate(kinds.items())
        }


def columns(sweep: Sweep) -> dict[str, str]:
    """Names and types of the columns of the table."""
    axes = {axis.name: "VARCHAR" if axis.numbers is None else "DOUBLE" for axis in sweep.plan.axes}
    ends = {"repeat": "BIGINT", "seed": "BIGINT", "pairing": "VARCHAR"}
    return {"cell": "BIGINT", **axes, **ends, **dict.fromkeys(sweep.measures, "DOUBLE")}


def table_rows(sweep: Sweep) -> Iterator[tuple[Any, ...]]:
    """One row a run, in the order of `columns`; None for what is not defined."""
    for row in sweep.rows:
        cell = sweep.plan.cells[row.cell]
        points = (axis.value(label) for axis, label in zip(sweep.plan.axes, cell.labels, strict=True))
        measured = (row.values.get(name) for name in sweep.measures)
        yield row.cell, *points, row.repeat, row.seed, cell.pairing, *measured


def write_table(sweep: Sweep) -> Path:
    """Write the table as Parquet; a table that was there is replaced in one step."""
    path = sweep.folder / TABLE_FILE
    write_parquet(path, columns(sweep), table_rows(sweep))
    return path


class Journal:
    """The folder of a sweep while it runs: opened by one process at a time, finished runs are added to it.

    Raises:
        BadInput: another process has it open, or its results are those of another sweep.
    """

    def __init__(self, folder: Path, plan: SweepPlan, repeat: int) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file = _locked(folder)
        try:
            self._rows = {(row.cell, row.repeat): row for row in _begin(folder, self._file, plan)}
            _write_definition(folder, plan, repeat)
        except BaseException:
            self._file.close()
            raise
        self._sweep = Sweep(folder, plan, repeat, ())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def has(self, cell: int, repeat: int) -> bool:
        """Whether a run is finished."""
        return (cell, repeat) in self._rows

    def add(self, row: Row) -> None:
        """Write a finished run down; it survives the end of this process."""
        line = dump(tag(row._asdict())) + b"\n"
        self._file.write(line)
        self._file.flush()
        os.fsync(self._file.fileno())
        self._rows[row.cell, row.repeat] = row

    def results(self) -> Sweep:
        """What is finished of the repetitions that were asked for."""
        rows = tuple(self._rows[key] for key in sorted(self._rows) if key[1] < self._sweep.repeat)
        return replace(self._sweep, rows=rows)


def _locked(folder: Path) -> IO[bytes]:
    file = (folder / JOURNAL_FILE).open("ab+")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise BadInput(
            f"{folder} is being worked on by another process: wait for it, or choose another --name"
        ) from None
    return file


def _begin(folder: Path, file: IO[bytes], plan: SweepPlan) -> list[Row]:
    """The runs that are in a journal of this plan, which is cut off after its last whole line; a new one is begun."""
    file.seek(0)
    text = file.read()
    whole = text[: text.rfind(b"\n") + 1]
    file.truncate(len(whole))
    if not whole:
        file.write(dump({"sweep": plan.digest}) + b"\n")
        file.flush()
        return []
    if (folder / SWEEP_FILE).is_file():
        _check_same(folder, plan)
    return _rows(folder, whole, plan)


def _check_same(folder: Path, plan: SweepPlan) -> None:
    """Refuse the results of another sweep, and say in what it is another."""
    there = _definition(folder)[0]
    if there.digest == plan.digest:
        return
    differ = [
        what
        for what, same in (
            (f"scenario {there.name}, not {plan.name}", there.name == plan.name),
            ("other axes", there.axes == plan.axes),
            (f"engine {there.engine}", there.engine == plan.engine),
            ("another seed", there.seed == plan.seed),
            ("scenarios with other fields", there.name != plan.name or _texts(there.cells) == _texts(plan.cells)),
            ("made with other versions or other code", there.made_with == plan.made_with),
        )
        if not same
    ]
    what = f"{folder} has the results of another sweep ({'; '.join(differ)})"
    raise BadInput(f"{what}: choose another --name, or --fresh to drop them")


def _texts(cells: Sequence[SweptCell]) -> list[str]:
    return [cell.scenario for cell in cells]


def _rows(folder: Path, text: bytes, plan: SweepPlan) -> list[Row]:
    head, *lines = text.splitlines()
    try:
        if json.loads(head).get("sweep") != plan.digest:
            raise BadInput(
                f"{folder / JOURNAL_FILE} is not of the sweep in {SWEEP_FILE}: it has the results of another"
            )
        plain = [untag(json.loads(line)) for line in lines]
        return [Row(**row) for row in plain]
    except (ValueError, TypeError, AttributeError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"{folder / JOURNAL_FILE} is damaged ({error}): --fresh begins anew") from error


def _write_definition(folder: Path, plan: SweepPlan, repeat: int) -> None:
    write_whole(folder / SWEEP_FILE, json.dumps({"repeat": repeat, **plan.to_json()}, indent=1, ensure_ascii=False))


def _definition(folder: Path) -> tuple[SweepPlan, int]:
    path = folder / SWEEP_FILE
    try:
        plain: Mapping[str, Any] = json.loads(path.read_text("utf-8"))
        return SweepPlan.from_json(plain), int(plain["repeat"])
    except OSError as error:
        raise BadInput(f"{folder} holds no sweep: {path.name} cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{path} is damaged: {error}") from error


def is_sweep(folder: Path) -> bool:
    """Whether a folder holds a sweep."""
    return (folder / SWEEP_FILE).is_file()


def load_sweep(folder: Path) -> Sweep:
    """The sweep in a folder, finished or not.

    Raises:
        BadInput: none there, damaged, or results that are not its own.
    """
    plan, repeat = _definition(folder)
    try:
        text = (folder / JOURNAL_FILE).read_bytes()
    except OSError as error:
        raise BadInput(f"{folder / JOURNAL_FILE} cannot be read: {error.strerror}") from error
    whole = text[: text.rfind(b"\n") + 1]
    found = {(row.cell, row.repeat): row for row in (_rows(folder, whole, plan) if whole else [])}
    return Sweep(folder, plan, repeat, tuple(found[key] for key in sorted(found) if key[1] < repeat))
