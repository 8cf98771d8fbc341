"""Runs as tables for other programs: one row for each component of each estimate, one row for each frame."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...errors import BadInput
from ..record.frame_fates import FrameFate, frame_fates
from ..record.record import Record
from ..whole_files import whole_file

Format = Literal["csv", "parquet", "npz"]
FORMATS: tuple[Format, ...] = ("csv", "parquet", "npz")
ESTIMATE_COLUMNS = {
    "agent": "VARCHAR",
    "time_ns": "BIGINT",
    "quantity": "VARCHAR",
    "sample": "BIGINT",
    "component": "BIGINT",
    "name": "VARCHAR",
    "value": "DOUBLE",
    "oracle": "DOUBLE",
    "truth": "DOUBLE",
}
_TEXT_FIELDS = {"source", "target", "verdict", "fate"}
FRAME_COLUMNS = {
    field: "VARCHAR" if field in _TEXT_FIELDS else "BOOLEAN" if field == "contradicted" else "BIGINT"
    for field in FrameFate._fields
}
TABLES = {"estimates": ESTIMATE_COLUMNS, "frames": FRAME_COLUMNS}


def write(record: Record, format: Format, out: Path) -> list[Path]:  # noqa: A002 - the field's word
    """Write a record as tables into a folder; the paths of the files.

    csv and parquet: estimates and frames, a file each. Values are in the agents' units, empty cells are what is not
    known, floats read back exactly. npz: run.npz, see `arrays`.

    Raises:
        BadInput: no such format.
    """
    if format not in FORMATS:
        raise BadInput(f"export format {format!r} is not known: one of {', '.join(FORMATS)}")
    out.mkdir(parents=True, exist_ok=True)
    if format == "npz":
        with whole_file(out / "run.npz") as partial:
            np.savez_compressed(partial, allow_pickle=False, **arrays(record))
        return [out / "run.npz"]
    rows = {"estimates": estimate_rows(record), "frames": frame_rows(record)}
    paths = [out / f"{name}.{format}" for name in TABLES]
    for (name, columns), path in zip(TABLES.items(), paths, strict=True):
        if format == "csv":
            _write_csv(path, columns, rows[name])
        else:
            write_parquet(path, columns, rows[name])
    return paths


def estimate_rows(record: Record) -> Iterator[tuple[Any, ...]]:
    """One row for each component of each estimate, in the order of ESTIMATE_COLUMNS."""
    for quantity, judged in record.evaluated.quantities.items():
        for agent, series in record.estimates(quantity).items():
            columns = series.value, judged.central[agent], judged.truth[agent]
            for row, (time_ns, sample) in enumerate(zip(series.time_ns.tolist(), series.sample.tolist(), strict=True)):
                for number, component in enumerate(judged.components):
                    numbers = (float(values[row, number]) for values in columns)
                    yield agent, time_ns, quantity, sample, number, component.name, *numbers


def frame_rows(record: Record) -> Iterator[tuple[Any, ...]]:
    """One row for each offered frame with all that is known of it, in the order of FRAME_COLUMNS."""
    for frames in frame_fates(record).values():
        yield from frames


def arrays(record: Record) -> dict[str, np.ndarray[Any, Any]]:
    """Flat arrays of a run.

    "<quantity>.agent" (n,) text, ".time_ns" and ".sample" (n,) int64, ".value", ".oracle" and ".truth" (n, k) float64;
    "frames.<field>" (m,) as in `frame_columns`.
    """
    found: dict[str, np.ndarray[Any, Any]] = {}
    for quantity, judged in record.evaluated.quantities.items():
        series = record.estimates(quantity)
        found[f"{quantity}.agent"] = np.repeat(list(series), [len(mine.sample) for mine in series.values()])
        for name in ("time_ns", "sample", "value"):
            found[f"{quantity}.{name}"] = np.concatenate([getattr(mine, name) for mine in series.values()])
        for name, reference in (("oracle", judged.central), ("truth", judged.truth)):
            found[f"{quantity}.{name}"] = np.concatenate([reference[agent] for agent in series])
    return found | {f"frames.{field}": values for field, values in frame_columns(record).items()}


def frame_columns(record: Record) -> dict[str, np.ndarray[Any, Any]]:
    """Field of `FrameFate` → its value for each frame, (m,); "" or −1 where it is not known."""
    frames = list(frame_rows(record))
    columns: dict[str, np.ndarray[Any, Any]] = {}
    for number, (field, kind) in enumerate(FRAME_COLUMNS.items()):
        unknown: Any = "" if kind == "VARCHAR" else -1
        values = [unknown if frame[number] is None else frame[number] for frame in frames]
        columns[field] = np.array(values, dtype={"VARCHAR": str, "BIGINT": np.int64, "BOOLEAN": bool}[kind])
    return columns


def _write_csv(path: Path, columns: Iterable[str], rows: Iterable[tuple[Any, ...]]) -> None:
    """Write rows with every text in quotes, an empty cell for None."""
    with whole_file(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        for row in ((*columns,), *rows):
            file.write(",".join(map(_cell, row)) + "\r\n")


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return '"' + value.replace('"', '""') + '"'
    return "" if value is None else repr(value)


def write_parquet(path: Path, columns: dict[str, str], rows: Iterable[tuple[Any, ...]]) -> None:
    """Write rows as Parquet, None for what is missing.

    Through CSV, the one way into duckdb that keeps NaN apart from what is missing.
    """
    import duckdb

    with whole_file(path) as partial, tempfile.TemporaryDirectory() as private, duckdb.connect() as database:
        source = Path(private) / "rows.csv"
        _write_csv(source, columns, rows)
        table = database.read_csv(str(source), header=True, columns=columns)
        table.write_parquet(str(partial), compression="zstd")
