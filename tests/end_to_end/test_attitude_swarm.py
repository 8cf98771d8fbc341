"""Measurement units as processes over Zenoh: with lost frames and failing sensors they are their twin."""

from __future__ import annotations

from collections.abc import Callable

from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import account, total

from .conftest import departures, run_swarm

FAULTS = (
    "faults=[{at: 1 s, until: 3 s, sensor: [1.magnetometer, single.accelerometer], failed: true}, "
    "{at: 2 s, sensor: 2.accelerometer, bias: [0.5, 0.5, 0.5]}, {at: 2 s, until: 3 s, kill: 3}]"
)


def test_lockstep_equals_the_twin_through_losses_and_failing_sensors(plan_of: Callable[..., Plan]) -> None:
    """Half of the frames lost, sensors failing and off, one unit dead for a second: equal to the last bit.

    The unit with the biased sensor puts it aside; the unit alone reports by itself.
    """
    record, ending = run_swarm(plan_of("attitude3-lossy", "duration=5 s", FAULTS))
    assert ending.problems == ()
    assert departures(record) == []
    assert set(record.estimates("attitude")) == {"1", "2", "3"}
    assert set(record.estimates("attitude-alone")) == {"single"}
    assert ("2", "sensor put aside") in [(note["agent"], note["what"]) for note in record.notes]
    accounts = account(record)
    lost = total(accounts.values())
    assert lost["lost (loss)"] > 0
    assert all(link.closes for link in accounts.values())
