"""Age of information: the sawtooth of each link, and its mean, quantile and peak over time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from volery.agents.journal import Arrived, Batch, Released
from volery.agents.plan import Plan
from volery.experiments.analysis.ages import AgeCourse, AgeMetrics, age_courses, age_metrics
from volery.experiments.record.record import Record
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli

MS = 1_000_000
LINK = ("1", "2")
Make = Callable[..., Any]


def course_of(record: Record) -> AgeCourse:
    """The age of information at "2" of "1"."""
    return age_courses(record)[LINK]


def test_age_falls_to_the_travel_time_at_each_delivery(record_of: Make, sent: Make, heard: Make) -> None:
    """Frames travel 5 ms and are sent at 0, 100 and 300 ms: the age rises to 105, 205 and, at the end, 700 ms."""
    times = (0, 100, 300)
    frames = [sent(number, start) for number, start in enumerate(times)]
    record = record_of(
        Batch("1", 0, sent=frames), Batch("2", 0, heard=[heard(number, start) for number, start in enumerate(times)])
    )
    course = course_of(record)
    assert course.at(np.array([0, 4, 5, 104, 105, 305, 999]) * MS).tolist()[2:] == [5e6, 104e6, 5e6, 5e6, 699e6]
    assert np.isnan(course.at(np.array([0, 4]) * MS)).all()
    teeth = ((5, 105), (5, 205), (5, 700))
    mean = sum((high**2 - low**2) / 2 for low, high in teeth) / 995 * MS
    # Only the last tooth is above 205 ms; 1 % of 995 ms lies above 700 − 9.95 ms.
    assert age_metrics(course) == pytest.approx(AgeMetrics(mean, 690.05 * MS, 700 * MS))


def test_quantile_is_that_of_the_ages_over_time(plan_of: Make, twin_run: Callable[[Plan], Record]) -> None:
    """Sampled every 0.1 ms, 99 % of the ages of a lossy link lie below it; sampling errs by one step at most."""
    record = twin_run(plan_of([LINK], 20_000, settings=LinkSettings(loss=(Bernoulli(0.5),))))
    course = course_of(record)
    ages = course.at(np.arange(course.time_ns[0], course.end_ns, MS // 10))
    found = age_metrics(course)
    assert found.p99_ns == pytest.approx(np.quantile(ages, 0.99), abs=MS / 10)
    assert found.mean_ns == pytest.approx(ages.mean(), abs=MS / 10)
    assert found.peak_ns == pytest.approx(ages.max(), abs=MS / 10)


def test_only_what_is_new_and_delivered_counts(record_of: Make, sent: Make, heard: Make) -> None:
    """A lost frame, and one that was overtaken by a newer one, leave the age as it was."""
    overtaken = sent(1, 50)._replace(due_ns=200 * MS)
    sender = Batch("1", 0, sent=[sent(0, 0), overtaken, sent(2, 100), sent(3, 300, "loss")])
    receiver = Batch(
        "2", 0, heard=[heard(0, 0), heard(2, 100), heard(1, 50)._replace(due_ns=200 * MS), heard(3, 300, "loss")]
    )
    assert course_of(record_of(sender, receiver)).time_ns.tolist() == [5 * MS, 105 * MS]


def test_age_falls_when_a_late_or_held_frame_comes(record_of: Make, sent: Make, heard: Make) -> None:
    """Not when it was due: handed over 20 ms later, and released at 200 ms."""
    sender = Batch("1", 0, sent=[sent(0, 0), sent(1, 100)])
    receiver = Batch("2", 0, heard=[heard(0, 0), heard(1, 100)], arrived=[Arrived("1", 0, 0, 24 * MS, 25 * MS)])
    receiver.released.append(Released("1", 0, 1, 200 * MS))
    course = course_of(record_of(sender, receiver))
    assert course.time_ns.tolist() == [25 * MS, 200 * MS]
    assert course.age_ns.tolist() == [25 * MS, 100 * MS]


def test_link_that_delivered_nothing_has_no_age(record_of: Make, sent: Make, heard: Make) -> None:
    """NaN throughout."""
    course = course_of(record_of(Batch("1", 0, sent=[sent(0, 0, "cut")]), Batch("2", 0, heard=[heard(0, 0, "cut")])))
    assert all(math.isnan(value) for value in vars(age_metrics(course)).values())
    assert np.isnan(course.at(np.array([0, 500 * MS]))).all()


def test_peaks_of_short_spans(record_of: Make, sent: Make, heard: Make) -> None:
    """The largest age in each span is that just before a delivery, or at its end; nothing before the first delivery."""
    times = (0, 100, 300)
    frames = [sent(number, start) for number, start in enumerate(times)]
    receiver = Batch("2", 0, heard=[heard(number, start) for number, start in enumerate(times)])
    course = course_of(record_of(Batch("1", 0, sent=frames), receiver))
    peaks = course.peaks(np.array([0, 4, 50, 110, 200, 1000]) * MS)
    assert np.isnan(peaks[0])
    assert (peaks[1:] / MS).round().tolist() == [50, 105, 100, 700]
