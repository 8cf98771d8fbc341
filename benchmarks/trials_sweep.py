"""Trial: a sweep of a thousand twin runs of ten agents, killed (kill -9) and resumed, and the same undisturbed.

Usage: python benchmarks/trials_sweep.py [RUNS [KILLS]]. The exit code is 1 if the two tables differ in any byte.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sweeps import CELLS, ESTIMATORS, LOSSES, TEN_NODES

RUNS, KILLS = 1000, 3


def main() -> int:
    """Run both sweeps and compare their tables."""
    runs, kills = (int(word) for word in (*sys.argv[1:], *map(str, (RUNS, KILLS)[len(sys.argv) - 1 :])))
    with tempfile.TemporaryDirectory() as place:
        folder, began = Path(place), time.monotonic()
        _sweep(folder, "undisturbed", runs).wait()
        print(f"undisturbed: {_lines(folder / 'undisturbed')} runs in {time.monotonic() - began:.0f} s")
        for kill in range(1, kills + 1):
            process = _sweep(folder, "killed", runs)
            while process.poll() is None and _lines(folder / "killed") < runs * kill / (kills + 1):
                time.sleep(0.02)
            process.kill()
            process.wait()
            print(f"killed after {_lines(folder / 'killed')} runs")
        _sweep(folder, "killed", runs).wait()
        tables = [(folder / name / "table.parquet").read_bytes() for name in ("undisturbed", "killed")]
        print(f"resumed to {_lines(folder / 'killed')} runs; tables of {len(tables[0]):,} and {len(tables[1]):,} bytes")
        print("the tables are equal, byte for byte" if tables[0] == tables[1] else "THE TABLES DIFFER")
        return int(tables[0] != tables[1])


def _sweep(folder: Path, name: str, runs: int) -> subprocess.Popen[bytes]:
    words = ["sweep", "dfa16", *(word for change in TEN_NODES for word in ("--set", change))]
    words += ["--over", LOSSES, "--over", ESTIMATORS, "--repeat", str(runs // CELLS)]
    command = [sys.executable, "-m", "volery", *words, "--runs", str(folder), "--name", name]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _lines(folder: Path) -> int:
    """Finished runs in the journal of a sweep."""
    journal = folder / "journal.jsonl"
    return max(0, journal.read_bytes().count(b"\n") - 1) if journal.exists() else 0


if __name__ == "__main__":
    sys.exit(main())
