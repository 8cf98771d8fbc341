"""What is written reads back equal: quantities, resolved scenarios; and the built-in scenarios, template and schema."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import units
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.library import builtin_scenarios
from volery.experiments.scenario.load import (
    Scenario,
    load_scenario,
    new_scenario_text,
    resolved_yaml,
    scenario_text,
)
from volery.experiments.scenario.validate import validate_plan
from volery.units import quantity

from .conftest import Load

BUILT_IN = [
    "altitude-lossy",
    "altitude-obstacles",
    "altitude-platform",
    "attitude3",
    "attitude3-lossy",
    "attitude3-scenes",
    "attitude8",
    "beacons",
    "beacons-moving",
    "dfa16",
    "dfa16-async",
    "dfa16-kill",
    "dfa16-lossy",
    "dfa4",
    "dfa8-random",
    "dfa-kalman",
    "dfa-sizes",
    "mav3",
    "mav3-delay",
    "mav3-fov",
    "mav30",
    "mav9",
    "mhe-altitude",
    "mhe-lossy",
    "mhe-pitch",
    "mhe-roll",
    "mhe-yaw",
    "radio-csma",
    "tracker",
]


@given(st.integers(-(10**20), 10**20))
def test_every_time_reads_back(time_ns: int) -> None:
    """Whole nanoseconds, however large."""
    assert units.parse(quantity(time_ns, "ns"), "ns") == time_ns


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["Hz", "bit/s", "m", "rad", "V"]))
def test_every_number_reads_back(value: float, unit: str) -> None:
    """Every bit of a float, in every unit."""
    assert units.parse(quantity(value, unit), unit) == value


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2_500_000, "ns", "2.5 ms"),
        (10_000_000_000, "ns", "10 s"),
        (1, "ns", "1 ns"),
        (115_200.0, "bit/s", "115.2 kbit/s"),
        (60.0, "Hz", "60 Hz"),
        (units.parse("5 deg", "rad"), "rad", "5 deg"),
    ],
)
def test_quantities_are_written_in_a_handy_unit(value: float, unit: str, text: str) -> None:
    """As a person would."""
    assert quantity(value, unit) == text


def _read_back(text: str, folder: Path) -> Scenario:
    path = folder / "resolved.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path).scenario


def test_a_resolved_scenario_reads_back_equal(load: Load, tmp_path: Path) -> None:
    """Overrides, models, faults of every sort and parameters of every sort come through."""
    scenario = load(
        "agents.gain={value: 0.1, reach: 25 cm}",
        "agents.lengths=[1 mm, 2 m]",
        "agents.wait=3 us",
        "agents.estimator=median",
        "links.only=[{where: [1-2, 3], loss: [0.1, 0.2], queue: {policy: latest}}, {where: 2>1, rate: null}]",
        "world={kind: plane, altitude: {steps: {0 s: 0.1 m, 1 s: 0.2 m}}}",
        "description='yes: {no}'",
        replacing=("", "  - {at: 1 s, for: 0.3 s, kill: 3}\n  - {at: 7 s, pause: 2}\n"),
    )
    assert _read_back(resolved_yaml(scenario), tmp_path) == scenario
    assert compile_plan(scenario).faults[2].until_ns == 1_300_000_000


EVERY_FAULT = """\
  - {at: 1 s, for: 0.3 s, hold: 1>2}
  - {at: 1.5 s, partition: [[1], rest], for: 1 ms}
  - {at: 1.6 s, partition: {isolate: 3}, for: 1 ms}
  - {at: 1.7 s, partition: halves, for: 1 ms}
  - {at: 2 s, for: 1 s, pause: [left, random 0.3]}
  - {at: 2 s, for: 1 s, hog: 2, share: 0.25}
  - {at: 2 s, clock: all, offset: -20 ms, drift: 50 ppm}
  - {every: {mtbf: 5 s, mttr: 100 ms}, from: 1 s, until: 9 s, cut: {random: 0.5}}
  - {at: 1 s, sensor: 1.distance, spikes: {size: [0.5], probability: 0.25}}
  - {at: 1 s, sensor: 2.distance, stuck: true}
  - {at: 1 s, sensor: 3.distance, noise: 0.5}
"""


def test_faults_of_every_kind_read_back_equal(load: Load, tmp_path: Path) -> None:
    """With groups, random fractions, partitions, processes, clocks, sensors; and so do the faults that follow."""
    scenario = load(
        "agents={kind: dfa-module}",
        "topology={hexagonal: 4}",
        "world={kind: plane, altitude: 0.2 m}",
        "links.rate=1 Mbit/s",
        "groups={left: [1, 2]}",
        replacing=("", EVERY_FAULT),
    )
    again = _read_back(resolved_yaml(scenario), tmp_path)
    assert again == scenario
    assert compile_plan(again).faults == compile_plan(scenario).faults


def test_resolving_writes_the_defaults_out(load: Load) -> None:
    """What a later version might choose otherwise stands in the file."""
    text = resolved_yaml(load())
    for line in ("compute: 1 ms", "mtu: 1500 B", "policy: drop-tail", "estimator: mean", "overload: false"):
        assert line in text


def test_the_built_in_scenarios_are_listed() -> None:
    """Each says what it shows, and those of a paper which figure they are about."""
    listed = {scenario.name: scenario for scenario in builtin_scenarios()}
    assert sorted(listed) == sorted(BUILT_IN)
    assert all(scenario.description for scenario in listed.values())
    for name, listed_one in listed.items():
        scenario = load_scenario(name).scenario
        assert (listed_one.paper, listed_one.description) == (scenario.paper, scenario.description.strip())


@pytest.mark.parametrize("name", BUILT_IN)
def test_every_built_in_scenario_compiles_and_reads_back(name: str, tmp_path: Path) -> None:
    """Nothing in it is over its bounds, no medium over 100 %."""
    loaded = load_scenario(name)
    scenario, plan = loaded.scenario, loaded.plan
    validation = validate_plan(plan)
    assert validation.puts_per_second is not None
    assert (plan.world is None and plan.coupled is None) == (scenario.world is None)
    assert f"name: {name}" in scenario_text(name)
    assert _read_back(resolved_yaml(scenario), tmp_path) == scenario


def test_the_cut_and_the_losses_of_the_demonstration_are_there() -> None:
    """`dfa16-lossy` cuts a link that exists for a second, and troubles all 60 directions for another."""
    cut, lossy = load_scenario("dfa16-lossy").plan.faults
    assert (cut.at_ns, cut.until_ns) == (3_000_000_000, 4_000_000_000)
    assert len(getattr(lossy, "links")) == 60  # noqa: B009 - a fault of links


def test_a_new_scenario_compiles(tmp_path: Path) -> None:
    """The template is a complete scenario under its name."""
    path = tmp_path / "mine.yaml"
    path.write_text(new_scenario_text("mine"), encoding="utf-8")
    plan = load_scenario(path).plan
    assert plan.name == "mine"
    validate_plan(plan)
