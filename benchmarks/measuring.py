"""Measurement of the benchmarks: samples in new interpreters, sides in turn, medians, verdicts."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

HERE = Path(__file__).parent
_SAMPLE_TIMEOUT_S = 120


def fresh(function: str, path: str | None = None, **arguments: Any) -> Any:
    """The result of `module:function` of this folder, called in a new interpreter.

    So no state, such as a running fork server, is carried over to the next sample. It runs with one BLAS thread, as
    agents' processes and the twin do. `path` is where the package is taken from, if not from where it is installed.

    Raises:
        RuntimeError: the sample failed; the message has its error output.
    """
    module, name = function.split(":")
    code = f"from {module} import {name}; from measuring import answer; answer({name})"
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(arguments)],
        cwd=HERE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **({} if path is None else {"PYTHONPATH": path})},
        capture_output=True,
        text=True,
        timeout=_SAMPLE_TIMEOUT_S,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{function} failed:\n{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def answer(function: Any) -> None:
    """Called by `fresh`: print the result as the last line."""
    print(json.dumps(function(**json.loads(sys.argv[1]))))


def in_turn(sides: Mapping[str, Mapping[str, Any]], repetitions: int) -> dict[str, list[Any]]:
    """Samples of each side, A B A B, so that other load on the machine affects all of them alike.

    Args:
        sides: name → {"function": "module:function", arguments…}.
        repetitions: number of samples of each side.
    """
    samples: dict[str, list[Any]] = {name: [] for name in sides}
    for _ in range(repetitions):
        for name, call in sides.items():
            samples[name].append(fresh(**call))
    return samples


def medians(samples: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The median of every field."""
    return {field: median(sample[field] for sample in samples) for field in samples[0]}


def median_ratio(samples: Sequence[Mapping[str, float]], beside: Sequence[Mapping[str, float]], field: str) -> float:
    """Median of the ratios of consecutive samples."""
    return median(own[field] / other[field] for own, other in zip(samples, beside, strict=True))


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table, the first column left-aligned, the others right-aligned."""
    cells = [[str(cell) for cell in row] for row in (head, *rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(head))]
    for row in cells:
        others = (cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))
        print("  ".join([row[0].ljust(widths[0]), *others]))


def verdict(what: str, value: float, bound: float, *, at_least: bool = False) -> None:
    """Print whether a bound is met."""
    met = value >= bound if at_least else value <= bound
    side = "at least" if at_least else "at most"
    print(f"{'met    ' if met else 'NOT MET'}  {what}: {value:,.4g}, asked {side} {bound:,.4g}")
