"""Vehicles in formation, flown in the twin: steps, lost packets, old packets, lost sight, death, and bad input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volery.errors import BadInput
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.evaluation import mav_evaluation
from volery.experiments.evaluation.evaluation import Series
from volery.experiments.evaluation.mav_findings import estimate_spread, mean_nees, pushed_centre, shape_errors
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.topologies import Formation

NO_STEPS = "agents.script=[]"
NO_FAULTS = "faults=[]"
QUIET = ("world.undisturbed=true", "links.loss=none", NO_FAULTS)
BURST = "faults=[{at: 2 s, for: 5 s, where: all, set: {loss: {bernoulli: 1.0}}}]"


def fly(name: str, *overrides: str, central: bool = False) -> Record:
    """The record of a scenario in the twin, if asked with what the centralised filter says."""
    plan = load_scenario(name, overrides).plan
    with pytest.MonkeyPatch.context() as patch:
        if not central:
            patch.setattr(mav_evaluation.MavEvaluation, "central_estimate", lambda *_: None)
        return recorded(plan)


def found(record: Record) -> dict[str, Any]:
    """Findings by name."""
    return {one.name: one for one in compute_metrics(record).findings}


def test_a_step_of_the_reference_is_flown_without_disturbances() -> None:
    """From A to B in r₁ₓ alone: 10 to 90 % within 0.4 to 2 s, no overshoot to speak of, and there to a centimetre."""
    step = "agents.script=[{at: 1 s, reference: B}]"
    record = fly("mav3", *QUIET, step, "duration=7 s")
    truth = record.world_reports["formation"]
    risen = (truth.value[:, 0] - truth.value[0, 0]) / 0.45
    tenth, most = (truth.time_ns[np.argmax(risen >= share)] * 1e-9 for share in (0.1, 0.9))
    assert 0.4 < most - tenth < 2.0
    assert risen.max() < 1.03
    assert abs(risen[-1] - 1.0) < 0.01 / 0.45
    others = truth.value[:, [1, 2, 6, 7, 8]]
    assert np.abs(others - others[0]).max() < 0.1
    assert found(record)["drift by differing estimates"].value < 0.1


def test_estimates_stand_beside_truth_and_centralised_filter() -> None:
    """All report the whole formation; without packets lost they are nearer to it than half a reference step."""
    record = fly("mav3", NO_STEPS, NO_FAULTS, "duration=4 s", "links.loss=none", central=True)
    seen = samples(record, "formation")
    late = seen.time_ns > 1_000_000_000
    assert seen.estimate.shape[2] == 12
    own = np.sqrt((seen.truth_error[late] ** 2).mean())
    central = np.sqrt(((seen.oracle - seen.truth)[late] ** 2).sum(axis=-1).mean())
    assert central < own < 1.0
    positions = [0, 1, 2, 6, 7, 8]
    assert np.sqrt(((seen.estimate - seen.truth)[late][..., positions] ** 2).mean()) < 0.1


def test_the_centralised_filter_takes_many_sightings_in_parts_to_the_same_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine vehicles that see several each: in one update or in several, the estimates differ by rounding."""
    flight = ("mav9", "duration=0.5 s", NO_STEPS, NO_FAULTS)
    apart = fly(*flight, central=True).central("formation")["1"]
    monkeypatch.setattr(mav_evaluation, "_AT_ONCE", 1_000)
    together = fly(*flight, central=True).central("formation")["1"]
    assert not np.array_equal(apart, together)
    assert np.abs(apart - together).max() < 1e-9


@pytest.mark.parametrize("seed", [1, 5])
def test_a_burst_drives_estimates_apart_and_the_radio_brings_them_back(seed: int) -> None:
    """Five seconds without a packet: tens of centimetres apart; within 1 s of the radio's return below 2.5 cm."""
    record = fly("mav3", NO_STEPS, BURST, "duration=9 s", f"seed={seed}")
    times, spread = estimate_spread(record.estimates("formation"))
    during = (times >= 2_000_000_000) & (times < 7_000_000_000)
    after = (times >= 7_000_000_000) & (times < 8_000_000_000)
    assert 0.15 < spread[during].max() < 1.0
    assert spread[after].min() < 0.025
    parameters = record.plan.agents[0].parameters
    assert shape_errors(parameters, record.world_reports["positions"]).max() < 0.45


def test_packets_used_as_if_fresh_break_the_loop_and_compensated_ones_do_not() -> None:
    """With 300 ms of latency: metres and more against decimetres, of which the air alone makes most."""
    compensated, ignored = (
        found(fly("mav3-delay", "duration=10 s", f"agents.filtering.delay={delay}"))["formation error"].value
        for delay in ("compensate", "ignore")
    )
    assert compensated < 0.25
    assert ignored > 20 * compensated


def test_lost_from_sight_and_found_again() -> None:
    """A formation that turns fast: vehicles lose whom they track, say so, turn to where it must be, and find it."""
    record = fly("mav3-fov", "duration=11 s")
    assert {"lost from sight", "in sight again"} <= {note["what"] for note in record.notes}
    assert found(record)["formation error"].value < 0.3


def test_the_others_go_on_without_a_vehicle_that_died() -> None:
    """It is left out by both, whoever tracked it tracks another one, and the report says what is unobservable now."""
    record = fly("mav3", NO_STEPS, "duration=12 s", "faults=[{at: 2 s, kill: 2}]")
    left = {(note["agent"], note["vehicle"]) for note in record.notes if note["what"] == "left out"}
    assert left == {("1", "2"), ("3", "2")}
    findings = found(record)
    assert "unobservable: r1, r2" in findings["without vehicle 2"].text
    assert "among those that are left all relative positions are observable" in findings["without vehicle 2"].text
    positions = record.world_reports["positions"]
    places = positions.value.reshape(-1, 3, 3)
    apart = np.linalg.norm(places[:, 0] - places[:, 2], axis=-1)[positions.time_ns > 9_000_000_000]
    assert abs(apart.mean() - 0.9) < 0.15


def test_those_who_are_cut_off_by_a_death_go_on_and_the_report_says_so() -> None:
    """On a line whose cameras reach to the next only, the death of the second cuts the first off: nothing ends."""
    line = ["topology={complete: 4}", "agents.references={A: {line: 1.5 m}}", "agents.camera_range=2 m", NO_STEPS]
    world = ["world.start={line: 1.5 m}", "world.camera={range: 2 m}"]
    record = fly("mav3", *line, *world, "agents.silence=1 s", "duration=5 s", "faults=[{at: 1 s, kill: 2}]")
    assert {note["vehicle"] for note in record.notes if note["what"] == "left out"} == {"2"}
    assert all(record.estimates("formation")[name].time_ns[-1] > 4_900_000_000 for name in "134")
    text = found(record)["without vehicle 2"].text
    assert text.endswith("unobservable: r1, r2; among those that are left no measured pair joins vehicles 3 4 with 1")


def test_who_has_come_back_is_not_counted_as_dead() -> None:
    """Each death stands for itself; when all are dead there is nobody left to say anything of."""
    record = fly("mav3", NO_STEPS, "duration=3 s", "faults=[{at: 1 s, for: 0.5 s, kill: 1}, {at: 2 s, kill: 3}]")
    assert found(record)["without vehicle 3"].text.startswith("unobservable: r2;")
    kills = "faults=[{at: 0.5 s, kill: 1}, {at: 0.6 s, kill: 2}, {at: 0.7 s, kill: 3}]"
    findings = found(fly("mav3", NO_STEPS, "duration=5 s", kills))
    assert findings["without vehicle 3"].text.endswith("there is nobody")
    assert "formation error" not in findings


def test_a_faulty_camera_harms_nobody_but_the_estimate() -> None:
    """Places and orientations are wrong, and who is seen is not."""
    faults = "[{at: 0.5 s, for: 1 s, sensor: 1.camera, noise: 1.0}, {at: 0.5 s, for: 1 s, sensor: 3.camera, bias: 1.0}]"
    record = fly("mav3", NO_STEPS, f"faults={faults}", "duration=2 s")
    assert all(mine.time_ns[-1] > 1_900_000_000 for mine in record.estimates("formation").values())
    with pytest.raises(BadInput, match=r"8 numbers and a sample of 1\.camera has 7"):
        load_scenario("mav3", [NO_STEPS, "faults=[{at: 1 s, sensor: 1.camera, bias: [0, 1, 0, 0, 0, 0, 0, 0]}]"])


def test_without_an_attitude_a_vehicle_holds_and_says_so() -> None:
    """Its inertial measurement unit has failed: forces in unknown axes are worse than none."""
    record = fly("mav3", NO_STEPS, "faults=[{at: 1 s, for: 1 s, sensor: 1.imu, failed: true}]", "duration=3 s")
    said = [(note["what"], note["time_ns"]) for note in record.notes if note["agent"] == "1"]
    (_, holds), (_, goes_on) = (said[0][0], said[0][1]), (said[1][0], said[1][1])
    assert [what for what, _ in said[:2]] == ["holds", "goes on"]
    forces = record.estimates("force")["1"]
    assert np.all(forces.value[(forces.time_ns >= holds) & (forces.time_ns < goes_on)] == 0.0)


@pytest.mark.parametrize(
    "fault", ["{at: 1 s, for: 1 s, pause: 1}", "{at: 1 s, for: 1 s, clock: 1, offset: 1 s}"], ids=["pause", "clock"]
)
def test_messages_that_were_missed_are_not_made_up_for(fault: str) -> None:
    """After a pause, or a jump of the own clock, the radio goes on with its rate; one message may follow at once."""
    record = fly("mav3", NO_STEPS, f"faults=[{fault}]", "duration=3 s")
    starts = sorted(sent.start_ns for sent in record.batches["1", 0].sent if sent.target == "2")
    assert 9 <= len(starts) <= 15
    assert (np.diff(starts) < 0.1e9).sum() <= 1


def test_a_clock_that_is_off_is_noticed() -> None:
    """Messages from the future cannot be run back, and frames of the camera from the past not be filtered."""
    record = fly("mav3", NO_STEPS, "faults=[{at: 1 s, for: 1 s, clock: 1, offset: 1.5 s}]", "duration=3 s")
    said = {(note["what"], note["agent"]) for note in record.notes}
    assert {("frame from the past", "1"), ("messages out of reach", "2"), ("messages out of reach", "3")} <= said


def test_nobody_is_left_out_when_all_are_silent() -> None:
    """It is the radio then."""
    record = fly("mav3", NO_STEPS, BURST, "duration=9 s", "agents.silence=1 s")
    assert not [note for note in record.notes if note["what"] == "left out"]


def test_blind_and_deaf_a_vehicle_holds_and_says_so() -> None:
    """Its camera has failed and no packet comes: it exerts nothing, and goes on when it hears again."""
    faults = "[{at: 1 s, for: 3 s, where: all, set: {loss: 1.0}}, {at: 1 s, for: 3 s, sensor: 1.camera, failed: true}]"
    record = fly("mav3", NO_STEPS, f"faults={faults}", "duration=5 s")
    said = [(note["what"], note["time_ns"]) for note in record.notes if note["agent"] == "1"]
    assert [what for what, _ in said] == ["lost from sight", "holds", "goes on", "in sight again"] or [
        what for what, _ in said
    ] == ["lost from sight", "holds", "in sight again", "goes on"]
    holds = next(time_ns for what, time_ns in said if what == "holds")
    forces = record.estimates("force")["1"]
    during = (forces.time_ns > holds) & (forces.time_ns < 4_000_000_000)
    assert during.any()
    assert np.all(forces.value[during] == 0.0)


def test_the_filter_says_when_it_is_overconfident() -> None:
    """Messages that tell again what was told count as news under `kalman`: its NEES is above the bound.

    Covariance intersection, which makes no such claim, stays below it. Both count attitudes as off by 3 degrees.
    """
    common = ("agents.report_covariance=1 Hz", NO_STEPS, NO_FAULTS, "duration=12 s", "agents.frames.noise=3 deg")
    kalman = fly("mav3", *common)
    careful = fly(
        "mav3", *common, "agents.filtering.fusion=intersection", "agents.messages={covariance: bound, packet: 58 B}"
    )
    value, _, high = mean_nees(kalman) or (0.0, 0.0, 0.0)
    assert value > high
    assert "overconfident" in found(kalman)["NEES per degree of freedom"].text
    value, _, high = mean_nees(careful) or (9.0, 0.0, 0.0)
    assert value < high


def test_frames_agree_better_with_consensus() -> None:
    """Miscalibrated by a degree or two each, vehicles that agree on a frame are nearer to each other in it."""
    common = (NO_STEPS, NO_FAULTS, "duration=8 s", "seed=3", "links.loss=none")
    agreed = found(fly("mav3", *common))["disagreement on the inertial frame"].value
    alone = found(fly("mav3", *common, "agents.frames.consensus=false"))["disagreement on the inertial frame"].value
    assert agreed < 0.85 * alone


def test_the_centre_is_pushed_by_differences_only() -> None:
    """Forces that sum to zero move nothing; a common one does, as ½ F/m t²."""

    def forces(force: float) -> Series:
        return Series(np.arange(0, 2_000_000_001, 100_000_000), np.arange(21), np.tile([force, 0.0, 0.0], (21, 1)))

    parameters = load_scenario("mav3").scenario.agents.parameters
    _, still = pushed_centre(parameters, {"1": forces(0.3), "2": forces(-0.3)})
    assert np.all(still == 0.0)
    _, moved = pushed_centre(parameters, {"1": forces(0.3), "2": forces(0.3)})
    np.testing.assert_allclose(moved[-1], [0.3 / 0.45 * 2.0, 0.0, 0.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["agents.tracks={1: 2, 2: 1, 3: 9}"], "vehicle 3 tracks 9: name another vehicle"),
        (["agents.references={A: {places: [[0 m, 0 m], [1 m, 0 m]]}}", NO_STEPS], "2 places for 3 vehicles"),
        (["agents.messages.packet=40 B"], "a packet of 40 B is too small"),
        (["agents.rate=1 Hz"], "longer than 250 ms is more than the prediction allows"),
        (["agents.rate=20 Hz"], "rate is 20 Hz and the camera has 30 Hz"),
        (["agents.filtering.camera_noise=0 m"], "camera_noise is 0 m"),
        (["agents.filtering.message_noise=0 m"], "position_noise is 0"),
        (["agents.filtering.acceleration_noise=0 m/s²"], "acceleration_noise is 0"),
        (["agents.frames.step=1.2"], "step is 1.2"),
        (
            ["agents.frames={consensus: false, step: 0.2}"],
            r"frames\.step is 0\.2, and consensus is false, .*: leave it out",
        ),
        (["agents.frames={consensus: false, anchor: 0.1}"], r"frames\.anchor is 0\.1, and consensus is false"),
        (
            ["agents.filtering={delay: ignore, history: 2 s}"],
            r"filtering\.history is 2 s, and delay is ignore",
        ),
        (
            ["agents.filtering.weighting=fast"],
            r"filtering\.weighting is fast, and fusion is kalman, which weighs nothing",
        ),
        (
            ["agents.filtering={fusion: intersection, message_noise: 2 cm}"],
            r"filtering\.message_noise is 0\.02 m, and fusion is intersection",
        ),
        (["agents.script=[{at: 1 s, reference: C}]"], "names reference 'C', and there is A, B"),
        (["agents.script=[{at: 2 s, reference: B}, {at: 1 s, reference: A}]"], "script goes back in time"),
        (["agents.camera_range=0.5 m"], "no measured pair joins vehicles"),
        (["links.latency=2 s"], "messages are older than"),
        (["world=null"], "mav needs a world that it can fly in"),
        (["topology={complete: 1}"], "complete"),
    ],
)
def test_bad_input_is_refused_with_its_place(changes: list[str], message: str) -> None:
    """Each with the value, the bound or the remedy."""
    with pytest.raises(BadInput, match=message):
        load_scenario("mav3", [*changes])


def test_an_assignment_that_cannot_be_observed_names_who_is_cut_off() -> None:
    """Two pairs that look at each other only."""
    with pytest.raises(BadInput, match="rank 12 of 18: no measured pair joins vehicles 1 2 with 3 4"):
        load_scenario(
            "mav3",
            [
                "topology={complete: 4}",
                "agents.references={A: {ring: 1 m}}",
                NO_STEPS,
                "world.start={ring: 1 m}",
                "agents.tracks={1: 2, 2: 1, 3: 4, 4: 3}",
            ],
        )


def test_parameters_read_back_equal(tmp_path: Path) -> None:
    """References and script survive being written to the folder of a run."""
    from volery.experiments.scenario.load import resolved_yaml

    scenario = load_scenario("mav3").scenario
    path = tmp_path / "again.yaml"
    path.write_text(resolved_yaml(scenario), "utf-8")
    assert load_scenario(path).scenario == scenario
    assert scenario.agents.parameters.references["A"] == Formation(triangle=0.9)


def test_components_of_a_formation_are_named_as_they_are_stored() -> None:
    """Place and velocity of each vehicle from the next; differences of the true places are what the names say."""
    record = fly("mav3", "duration=1 s", NO_FAULTS)
    components = {name: quantity.components for name, quantity in record.evaluated.quantities.items()}
    labels = components["formation"]
    assert labels[0] == ("x of 1 from 2", "m", 1.0)
    assert [name for name, _, _ in labels[5:7]] == ["velocity z of 1 from 2", "x of 2 from 3"]
    assert [unit for _, unit, _ in labels] == (["m"] * 3 + ["m/s"] * 3) * 2
    metrics = compute_metrics(record).quantities["formation"]
    assert [one.name for one in metrics.components] == [name for name, _, _ in labels]
    places = record.world_reports["positions"].value[0].reshape(3, 3)
    truth = samples(record, "formation").truth[0, 0]
    np.testing.assert_allclose(truth[[0, 6]], [places[0, 0] - places[1, 0], places[1, 0] - places[2, 0]], atol=1e-12)
    assert components["force"][2] == ("force z", "N", 1.0)
    assert components["covariance"][0] == ("covariance [0]", "", 1.0)
