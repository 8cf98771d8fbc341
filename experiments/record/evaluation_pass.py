"""The evaluation of a run: one pass over its record in the order of events, nominal stamps, sensor faults applied.

At one instant commands take effect first, then come delivered frames, samples in the order of the plan, and then
questions about reports. What was sensed or sent by nobody, as by the dead, is not in the record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import methodcaller
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...agents.agent import Received, Sample
from ...agents.call_checks import covariance, numbers, whole_number
from ...errors import BadInput
from ...estimators.information import pack_symmetric
from ...quantities import Component, Floats, Quantity, subtracted
from ...user_code import names_user_code
from ..evaluation.evaluation import Evaluation, Finding, distance_to_mean, evaluations
from ..evaluation.evaluation_result import EvaluatedQuantity, EvaluationResult, save_evaluation
from .channels import channels_to_keep
from .normalised_errors import normalised_squares, standard_deviations
from .places import Reports, followed_places, true_places, view_places
from .record import Record
from .run_files import EVALUATION_FILE
from .side_by_side import side_by_side, take

_COMMAND, _PAYLOAD, _SAMPLE, _REPORT = range(4)


class _Step(NamedTuple):
    """Something to tell or to ask evaluations: its instant, and its place among all of that instant."""

    time_ns: int
    place: tuple[int, int, int]
    judges: tuple[Evaluation, ...]
    act: Callable[[Evaluation], None]


class _References(NamedTuple):
    """What is known about the reports of one agent, (n, k) each."""

    truth: Floats
    central: Floats


_Known = Mapping[str, Mapping[str, _References]]


@names_user_code
def evaluated(record: Record) -> Record:
    """The record with its evaluation.

    Raises:
        BadInput: reports that differ in length, components or references of another length than the reports.
    """
    judges = evaluations(record.as_run, record.world_reports)
    reports = {quantity: record.estimates(quantity) for quantity in record.quantities()}
    known = {
        quantity: {agent: _References(*np.full((2, *mine.value.shape), np.nan)) for agent, mine in series.items()}
        for quantity, series in reports.items()
    }
    steps = [*_facts(record, tuple(dict.fromkeys(judges.values()))), *_questions(judges, reports, known)]
    for step in sorted(steps, key=lambda step: step[:2]):
        for judge in step.judges:
            step.act(judge)
    quantities = {
        quantity: _judged(record, judges[next(iter(series))].declared(quantity), reports, known)
        for quantity, series in reports.items()
    }
    compared = replace(record, evaluation=EvaluationResult(quantities))
    result = EvaluationResult(
        quantities,
        tuple(finding for judge in dict.fromkeys(judges.values()) for finding in _findings(judge, compared)),
        true_places(record),
        view_places(reports, judges),
        followed_places(reports, {name: one.truth for name, one in quantities.items()}, judges),
        channels_to_keep(record),
    )
    return replace(record, evaluation=result)


def evaluate_run(record: Record, folder: Path) -> Record:
    """The record with its evaluation, which is left in the folder of the run; raises as `evaluated` does."""
    found = evaluated(record)
    save_evaluation(found.evaluated, folder / EVALUATION_FILE)
    return found


# -- the pass ---------------------------------------------------------------------------------------------------------


def _facts(record: Record, judges: tuple[Evaluation, ...]) -> Iterator[_Step]:
    """Commands, payloads and samples, for every evaluation."""
    order = {agent.name: number for number, agent in enumerate(record.plan.all_agents)}
    world = record.plan.world or record.plan.coupled
    for (agent, _), batch in record.batches.items():
        for number, (time_ns, source, command, value) in enumerate(batch.commands):
            tell = methodcaller("commanded", source, command, np.array(value, dtype=np.float64), time_ns)
            yield _Step(time_ns, (_COMMAND, number, 0), judges, tell)
        for number, (time_ns, source, content) in enumerate(batch.payloads):
            measured = batch.measured[number].value if batch.measured else None
            seen = None if measured is None else np.array(measured, dtype=np.float64)
            tell = methodcaller("received", agent, Received(source, bytes.fromhex(content), time_ns, seen))
            yield _Step(time_ns, (_PAYLOAD, order[agent], number), judges, tell)
        sensors = list(world.sensors(agent)) if world is not None and batch.samples else []
        for sensor, index, time_ns, shape, flat in batch.samples:
            seen = None if flat is None else np.array(flat, dtype=np.float64).reshape(shape)
            tell = methodcaller("sampled", agent, Sample(sensor, index, time_ns, seen))
            yield _Step(time_ns, (_SAMPLE, order[agent], sensors.index(sensor)), judges, tell)


def _questions(judges: Mapping[str, Evaluation], reports: Reports, known: _Known) -> Iterator[_Step]:
    """What is true, and what the central estimator says, of each report, at the instant that it is about.

    There is no truth of innovations and covariances.
    """
    declared = {quantity: judges[next(iter(series))].declared(quantity) for quantity, series in reports.items()}
    covariances = {one.covariance_quantity for one in declared.values()}
    for quantity, series in reports.items():
        has_truth = declared[quantity].role != "innovation" and quantity not in covariances
        for agent, mine in series.items():
            judge = judges[agent]
            for row, (index, time_ns) in enumerate(zip(mine.sample.tolist(), mine.time_ns.tolist(), strict=True)):
                instant_ns = judge.instant(agent, quantity, index, time_ns)
                instant_ns = whole_number(instant_ns, f"agent {agent}", f"the instant of {quantity!r}")
                ask = partial(_ask, known[quantity][agent], row, (agent, quantity, index, instant_ns), has_truth)
                yield _Step(instant_ns, (_REPORT, 0, 0), (judge,), ask)


def _ask(known: _References, row: int, report: tuple[str, str, int, int], has_truth: bool, judge: Evaluation) -> None:
    agent, quantity, *_ = report
    for what, references, value in (
        ("truth", known.truth, judge.truth(*report) if has_truth else None),
        ("central estimate", known.central, judge.central_estimate(*report)),
    ):
        if value is not None:
            references[row] = _fitting(value, references.shape[1], f"agent {agent}", f"the {what} of {quantity!r}")


def _fitting(value: ArrayLike, width: int, agent: str, what: str) -> Floats:
    """A value as agents report it: flat; of a covariance perhaps the upper triangle."""
    array = numbers(value, agent, what)
    flat = array.ravel()
    if len(flat) != width and array.ndim == 2 and array.shape[0] == array.shape[1]:
        flat = pack_symmetric(covariance(array, agent, what))
    if len(flat) != width:
        raise BadInput(f"{agent}: {what} has {len(flat)} components, the agents report {width}")
    return flat


def _findings(judge: Evaluation, run: Record) -> Sequence[Finding]:
    found = tuple(judge.findings(run))
    if wrong := [one for one in found if not isinstance(one, Finding)]:
        raise BadInput(f"evaluation {type(judge).__name__}: findings has {wrong[0]!r}: return a list of Finding(…)")
    return found


# -- what follows of each quantity ------------------------------------------------------------------------------------


def _judged(record: Record, quantity: Quantity, reports: Reports, known: _Known) -> EvaluatedQuantity:
    series = reports[quantity.name]
    time_ns, index, rows = side_by_side(series, record.faults)
    truth, central = (
        {agent: getattr(one, reference) for agent, one in known[quantity.name].items()}
        for reference in _References._fields
    )
    first, plain = next(iter(series)), quantity.difference is subtracted

    def differences(references: Mapping[str, Floats]) -> dict[str, Floats]:
        return {agent: _difference(quantity, mine.value, references[agent]) for agent, mine in series.items()}

    of_truth = differences(truth)
    width, difference_width = series[first].value.shape[1], of_truth[first].shape[1]
    own = quantity.difference_components
    return EvaluatedQuantity(
        _numbered(quantity.name, quantity.components, width),
        _numbered(quantity.name, quantity.components if own is None else own, difference_width),
        quantity.role,
        quantity.is_shared,
        time_ns,
        index,
        rows,
        truth,
        central,
        {} if plain else of_truth,
        {} if plain else differences(central),
        distance_to_mean(quantity, np.stack([take(series[agent].value, rows[agent]) for agent in series], axis=1)),
        *_normalised(quantity, reports, known, of_truth),
    )


def _difference(quantity: Quantity, estimate: Floats, reference: Floats) -> Floats:
    """That of all rows, by the quantity's own function."""
    found = quantity.difference(estimate, reference)
    if np.ndim(found) != 2 or len(found) != len(estimate):
        shape, given = np.shape(found), estimate.shape
        raise BadInput(f"{quantity.name!r}: its difference of arrays {given} has the shape {shape}, and must be (…, m)")
    return found


_Rows = dict[str, Floats]


def _normalised(
    quantity: Quantity, reports: Reports, known: _Known, of_truth: Mapping[str, Floats]
) -> tuple[_Rows, _Rows, _Rows]:
    """Agent → standard deviations, NEES or NIS, and NEES of the central estimator, where covariances were reported."""
    deviation: _Rows = {}
    squares: _Rows = {}
    central: _Rows = {}
    if quantity.role == "diagnostic":
        return deviation, squares, central
    for agent, stated_covariance in reports.get(quantity.covariance_quantity, {}).items():
        if (mine := reports[quantity.name].get(agent)) is None:
            continue
        error = mine.value if quantity.role == "innovation" else of_truth[agent]
        references = known[quantity.name][agent]
        oracle_covariance = stated_covariance._replace(value=known[quantity.covariance_quantity][agent].central)
        try:
            deviation[agent] = standard_deviations(mine, stated_covariance, error.shape[1])
        except BadInput as wrong:
            raise BadInput(f"{quantity.name!r} of agent {agent}: {wrong}") from wrong
        squares[agent] = normalised_squares(mine, error, stated_covariance)
        central_error = _difference(quantity, references.central, references.truth)
        central[agent] = normalised_squares(mine, central_error, oracle_covariance)
    return deviation, squares, central


def _numbered(name: str, components: Sequence[Component], count: int) -> tuple[Component, ...]:
    """The components that are declared, numbered where none are."""
    if not components:
        return tuple(Component(f"{name} [{number}]" if count > 1 else name) for number in range(count))
    if len(components) != count:
        raise BadInput(f"{name!r} is declared with {len(components)} components, and has {count}")
    return tuple(components)
