"""Failures and repairs at random: their law, their independence, and what an entry of the timeline makes of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import kstest

from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.expansion import entry_of
from volery.experiments.scenario.fault_processes import Every, renewals
from volery.transport.faults import Kill, LinkFault

from .conftest import Load, Refusal

SECOND = 1_000_000_000
EVERY = Every(5 * SECOND, SECOND)


def test_times_to_failure_and_to_repair_are_exponential_and_independent() -> None:
    """Kolmogorov–Smirnov against both laws, and no correlation of neighbouring times beyond four standard errors."""
    spans = renewals(EVERY, 0, 120_000 * SECOND, 1, "t1", "1", "2")
    begins, ends = np.array(spans[:-1], dtype=float).T / SECOND
    up, down = begins - np.concatenate([[0.0], ends[:-1]]), ends - begins
    assert len(spans) > 18_000
    assert kstest(up, "expon", args=(0, 5)).pvalue > 0.001
    assert kstest(down, "expon", args=(0, 1)).pvalue > 0.001
    assert abs(np.corrcoef(up, down)[0, 1]) < 4 / math.sqrt(len(up))
    assert abs(np.corrcoef(up[1:], up[:-1])[0, 1]) < 4 / math.sqrt(len(up))


def test_the_fraction_of_time_that_a_place_is_faulty() -> None:
    """MTTR / (MTBF + MTTR), within 3 standard errors of an alternating renewal process.

    Over a time T the faulty time has variance T·(σ_d²·m_u² + σ_u²·m_d²)/(m_u + m_d)³ (Takács 1957), here with
    exponential times, σ = m.
    """
    total_s, up_s, down_s = 200_000, 5, 1
    faulty_s = sum(end - begin for begin, end in renewals(EVERY, 0, total_s * SECOND, 2, "t1", "9")) / SECOND
    error_s = math.sqrt(total_s * 2 * (up_s * down_s) ** 2 / (up_s + down_s) ** 3)
    assert faulty_s == pytest.approx(total_s / 6, abs=3 * error_s)


def test_each_span_lies_within_and_apart() -> None:
    """From `from` on, clipped at the end, ascending, none empty."""
    spans = renewals(Every(10, 10), 100, 1_000, 1, "t1", "1")
    times = [time for span in spans for time in span]
    assert times == sorted(set(times))
    assert times[0] > 100
    assert times[-1] <= 1_000


def test_another_place_another_fault_and_another_seed_draw_anew() -> None:
    """The stream belongs to the place, the entry and the seed, and a longer run only goes on."""
    one = renewals(EVERY, 0, 100 * SECOND, 1, "t1", "1", "2")
    begins = [begin for begin, _ in renewals(EVERY, 0, 200 * SECOND, 1, "t1", "1", "2")]
    assert [begin for begin, _ in one] == begins[: len(one)]
    others = [
        renewals(EVERY, 0, 100 * SECOND, 1, "t1", "2", "3"),
        renewals(EVERY, 0, 100 * SECOND, 1, "t2", "1", "2"),
        renewals(EVERY, 0, 100 * SECOND, 2, "t1", "1", "2"),
    ]
    assert all(one != other for other in others)


def process(load: Load, fields: str) -> list[LinkFault | Kill]:
    """The faults of an entry with a random process, in the example of 10 s."""
    plan = compile_plan(load(replacing=("faults:\n", f"faults:\n  - {{{fields}}}\n")))
    return [fault for fault in plan.faults if entry_of(fault.id) == "t1" and isinstance(fault, LinkFault | Kill)]


def test_every_edge_fails_by_itself(load: Load) -> None:
    """Both directions of an edge at once, the edges at their own times, named in the order of time."""
    faults = process(load, "every: {mtbf: 1 s, mttr: 0.3 s}, from: 2 s, until: 8 s, cut: all")
    links = [fault.links for fault in faults if isinstance(fault, LinkFault)]
    assert set(links) == {(("1", "2"), ("2", "1")), (("2", "3"), ("3", "2"))}
    assert [fault.id for fault in faults] == [f"t1.{number}" for number in range(1, len(faults) + 1)]
    times = [fault.at_ns for fault in faults]
    assert times == sorted(times)
    assert times[0] >= 2 * SECOND
    assert all(fault.until_ns is not None and fault.until_ns <= 8 * SECOND for fault in faults)
    one_way = process(load, "every: {mtbf: 1 s, mttr: 0.3 s}, cut: 1>2")
    assert {fault.links for fault in one_way if isinstance(fault, LinkFault)} == {(("1", "2"),)}


def test_all_together(load: Load) -> None:
    """One process for all places; a partition is always one."""
    for where in ("together: true}, cut: all", "}, partition: isolate 1", "}, partition: [[1], [2, 3]]"):
        faults = process(load, f"every: {{mtbf: 1 s, mttr: 0.3 s, {where}".replace(", }", "}"))
        assert len(faults) > 2
        assert len({getattr(fault, "links") for fault in faults}) == 1  # noqa: B009
    kills = process(load, "every: {mtbf: 2 s, mttr: 0.5 s, together: true}, kill: [1, 3]")
    at = [fault.at_ns for fault in kills]
    assert at[::2] == at[1::2]


def test_what_a_process_draws_may_meet_what_is_there_already(load: Load) -> None:
    """Drawn instants contradict nothing: links that are cut already may fail too."""
    faults = process(load, "every: {mtbf: 0.2 s, mttr: 0.2 s}, cut: 1-2")
    assert any(3 * SECOND <= fault.at_ns < 4 * SECOND for fault in faults)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ("every: {mtbf: 1 s, mttr: 1 s}, at: 1 s, cut: 1-2", "write when it starts, at: 3 s, or a random process"),
        ("cut: 1-2", "write when it starts, at: 3 s, or a random process"),
        ("every: {mtbf: 1 s, mttr: 1 s}, for: 1 s, cut: 1-2", "for does not go with every"),
        ("at: 1 s, from: 1 s, cut: 1-2", "from belongs to every"),
        ("every: {mtbf: 1 s}, cut: 1-2", "faults.0.every.mttr: is missing"),
        ("every: {mtbf: 1 s, mttr: 1 s}, from: 3 s, until: 2 s, cut: 1-2", "until is 2 s and from 3 s"),
        ("every: {mtbf: 1 s, mttr: 1 s}, from: 11 s, cut: 1-2", "faults.0.from: starts at 11 s, the run ends at 10 s"),
        ("every: {mtbf: 1 us, mttr: 1 us}, cut: 1-2", "about 5,000,000 faults would come of this, 10,000 are the most"),
        ("every: {mtbf: 2 ms, mttr: 1 ms}, cut: 1-2", "about 3,333 faults would come of this, 1,000 are the most"),
        ("every: {mtbf: 1 us, mttr: 1 us, often: 3}, cut: 1-2", "faults.0.every.often: unknown field"),
    ],
)
def test_a_process_that_is_none(refusal: Refusal, fields: str, message: str) -> None:
    """The message names the field."""
    assert message in refusal(replacing=("faults:\n", f"faults:\n  - {{{fields}}}\n"))
