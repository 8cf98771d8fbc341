"""Common to all sides of a benchmark: graph, send times, and summaries of samples."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

SECOND_NS = 1_000_000_000
BEGIN_NS = SECOND_NS // 2
"""Start of the measurement, after a warm-up of caches and connections."""
PAYLOAD_BYTES = 40


def end_ns(seconds: float) -> int:
    """End of the measurement [ns], a little before the end of the run."""
    return int(seconds * SECOND_NS) - 50_000_000


def ring(agents: int, degree: int) -> dict[str, tuple[str, ...]]:
    """Agent → neighbours, on a ring in which each sends to its `degree` nearest agents."""
    steps = [step for reach in range(1, degree // 2 + 1) for step in (reach, -reach)]
    return {str(i + 1): tuple(str((i + step) % agents + 1) for step in steps) for i in range(agents)}


def phase_ns(index: int, agents: int, rate: float) -> int:
    """Send time of an agent within its period [ns], spread evenly over all agents."""
    return int(SECOND_NS / rate * index / agents)


def quantile(ordered: Sequence[float], share: float) -> float:
    """The value below which a share of the ordered values lies."""
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def delay_summary(errors_ns: Iterable[float]) -> dict[str, float]:
    """Minimum, median and 99th percentile [µs], and number of frames."""
    errors = sorted(error / 1e3 for error in errors_ns)
    return {"min": errors[0], "p50": quantile(errors, 0.5), "p99": quantile(errors, 0.99), "frames": len(errors)}


def cpu_summary(meters: Sequence[Sequence[float]]) -> dict[str, float]:
    """µs per frame from (processor seconds, frames) of each process."""
    frames = sum(count for _, count in meters)
    return {"cpu_us": sum(cpu_s for cpu_s, _ in meters) / frames * 1e6, "frames": frames}


def pss_mb(pids: Sequence[int]) -> float:
    """Mean proportional set size of processes, in MB."""
    sizes = []
    for pid in pids:
        rollup = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
        sizes.append(next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:")))
    return sum(sizes) / len(sizes) / 1024
