"""One run of a sweep, in whatever process, and what is kept of it: a flat mapping of numbers.

Where an agent reported anything that is not finite, all about that quantity is infinite: it diverged.

quantity.error.measure      error one of disagreement, oracle_error, truth_error; measure steady_rms, final, … as in
                            `metrics.ErrorMetrics`
quantity.component.error    steady-state rms of one component, the unit at the end of its name
quantity.name               other numbers about a quantity, such as contraction
quantity.nees               mean NEES over the dimension, of innovations quantity.nis: 1 where the covariance is right
findings.name               findings of the evaluation, and how often what was noted
links.…                     delivered_fraction of what was put on the air; bytes_per_agent_s, payload on the air, what
                            all neighbours hear counted once; medium_lost_fraction, by half-duplex, collision or access;
                            age_s, mean age of information; airtime, of the busiest medium
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np

from ...agents.plan_codec import decode_plan
from ...errors import RunFailed, VoleryError
from ...transport.links import ACCESS, COLLISION, HALF_DUPLEX
from ...transport.media_settings import on_air
from ..analysis.metrics import ErrorMetrics, Metrics, QuantityMetrics, compute_metrics
from ..execution import Options, Outcome, execute
from ..record.record import Record, load
from ..twin import recorded
from .sweep_plan import Job

Values = dict[str, float | None]
_NOT_MEASURES = ("threshold", "samples", "agents")
_MEDIUM = (HALF_DUPLEX, COLLISION, ACCESS)


def run_job(job: Job) -> Values:
    """Carry out one run; what was measured, None for what is not defined.

    Raises:
        RunFailed: it could not be carried through; the message names the cell and the seed.
    """
    sys.path.extend(path for path in job.paths if path not in sys.path)
    try:
        return measure(_record(job))
    except Exception as error:
        raise RunFailed(f"cell {job.cell}, seed {job.seed}: {type(error).__name__}: {error}") from error


def measure(record: Record) -> Values:
    """The numbers of a run."""
    metrics = compute_metrics(record)
    findings = {f"findings.{one.name}": one.value for one in metrics.findings}
    tests = {f"{quantity}.{one.test.lower()}": one.mean for quantity, one in metrics.consistency.items()}
    found = {**dict(_of_quantities(metrics)), **tests, **dict(_of_links(record, metrics)), **findings}
    for quantity in record.evaluated.compared():
        if not all(np.isfinite(series.value).all() for series in record.estimates(quantity).values()):
            found.update({name: math.inf for name in found if name.startswith(f"{quantity}.")})
    return {name: None if math.isnan(value) else value for name, value in found.items()}


def _record(job: Job) -> Record:
    if job.engine == "twin" and job.keep is None:
        return recorded(decode_plan(job.plan))
    with tempfile.TemporaryDirectory(prefix="volery-") as private:
        folder = Path(private) / "run" if job.keep is None else Path(job.keep)
        shutil.rmtree(folder, ignore_errors=True)
        if job.engine == "twin":
            return _execute(job, folder).record
        _over_zenoh(job, folder)
        return load(folder)


def _execute(job: Job, folder: Path) -> Outcome:
    """The run in its folder; over Zenoh in lockstep pace."""
    options = Options(job.engine, "lockstep", runs=folder.parent, name=folder.name, figures=False)
    return execute(decode_plan(job.plan), job.scenario, options)


def _over_zenoh(job: Job, folder: Path) -> None:
    """The run by a supervisor in a process of its own, as workers of some pools may start no processes by fork."""
    command = [sys.executable, "-m", __spec__.name, str(folder)]
    job_text = json.dumps(job._asdict())
    done = subprocess.run(command, input=job_text, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    if done.returncode:
        raise RunFailed(done.stderr.strip())


def _of_quantities(metrics: Metrics) -> Iterator[tuple[str, float]]:
    for name, quantity in metrics.quantities.items():
        for measured in fields(QuantityMetrics):
            value = getattr(quantity, measured.name)
            if isinstance(value, ErrorMetrics):
                for one in fields(value):
                    if one.name not in _NOT_MEASURES:
                        yield f"{name}.{measured.name}.{one.name}", getattr(value, one.name)
            elif isinstance(value, float | int) and measured.name not in _NOT_MEASURES:
                yield f"{name}.{measured.name}", float(value)
        for component in quantity.components:
            label = f"{component.name}_{component.unit}" if component.unit else component.name
            yield f"{name}.{label}.oracle_error", component.oracle_rms
            yield f"{name}.{label}.truth_error", component.truth_rms


def _of_links(record: Record, metrics: Metrics) -> Iterator[tuple[str, float]]:
    accounts = [link.account for link in metrics.links.values()]
    transmitted = sum(one.transmitted for one in accounts)
    by_medium = sum(one.lost.get(cause, 0) for one in accounts for cause in _MEDIUM)
    tried = sum(one.transmitted + one.lost.get(ACCESS, 0) for one in accounts)
    ages = [link.age.mean_ns for link in metrics.links.values() if not math.isnan(link.age.mean_ns)]
    yield "links.delivered_fraction", _ratio(sum(one.delivered for one in accounts), transmitted)
    yield "links.medium_lost_fraction", _ratio(by_medium, tried)
    yield "links.bytes_per_agent_s", _ratio(_bytes(record), len(record.plan.agents) * metrics.seconds)
    yield "links.age_s", _ratio(sum(ages) / 1e9, len(ages))
    yield "links.airtime", max(metrics.airtime.values(), default=math.nan)


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else math.nan


def _bytes(record: Record) -> int:
    """Payload that was put on the air; what one transmission carried to several counts once."""
    sent: dict[tuple[str, int, str, int, int], int] = {}
    for (agent, incarnation), batch in record.batches.items():
        for frame in batch.sent:
            shared = on_air(record.plan.links[agent, frame.target].medium)
            number = 0 if shared else frame.sequence
            sent[agent, incarnation, "" if shared else frame.target, frame.start_ns, number] = frame.size
    return sum(sent.values())


def _main(folder: Path) -> None:
    """Carry out the job on the standard input."""
    job = Job(**json.load(sys.stdin))
    sys.path.extend(path for path in job.paths if path not in sys.path)
    try:
        problems = _execute(job, folder).record.problems
    except VoleryError as error:
        problems = (str(error),)
    if problems:
        sys.exit("\n".join(problems))


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
