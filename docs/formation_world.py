"""Draws the figure of docs/formation-world.md and prints the numbers that the page quotes.

Usage: python docs/formation_world.py motion|view|passage|all [--out docs/images]
"""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge
from numpy.typing import NDArray

from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, PAGE_IN, SKY, STYLE, VERMILION
from volery.experiments.scenario.explaining import read
from volery.rotations import rotate
from volery.topologies import Formation
from volery.units import period_ns
from volery.worlds.formation.formation_flight import RunningFormation
from volery.worlds.formation.formation_world import FormationWorld
from volery.worlds.formation.vehicles import Vehicle
from volery.worlds.world_kinds import AnyWorld

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
SECOND_NS = 1_000_000_000
RATE = 30.0
UP = np.array([0.0, 0.0, 1.0])
SIX: dict[str, Any] = {"start": {"grid": "1.2 m"}}
BEFORE = {"triangle": "1.2 m"}
AFTER = {"triangle": "1.2 m", "moved": {1: ["-2.08 m", 0, 0]}}
START_S, END_S = 2.0, 12.0
STIFFNESS, DAMPING = 2.8, 2.3
TURN, TURN_SUM = 2.5, 0.5
LAG_NS = 11_000_000


def world(count: int, **spec: Any) -> FormationWorld:
    """A formation as a scenario would have it."""
    agents = tuple(str(number) for number in range(1, count + 1))
    found: FormationWorld = read(AnyWorld, {"kind": "formation", **spec}).build({}, 1, agents)
    return found


# -- How vehicles move --------------------------------------------------------------------------------------------


def motion() -> Iterator[str]:
    """The tilt's step response, the error of the integration, and how far the turbulence takes vehicles."""
    yield from _step_response(Vehicle())
    yield from _integration()
    yield from _turbulence()


def _step_response(vehicle: Vehicle) -> Iterator[str]:
    start = {"line": "2 m"}
    wanted = math.atan(0.2)
    running = world(2, start=start, steps="1000 Hz", undisturbed=True).begin()
    running.act("1", "thrust", 0.2 * vehicle.weight * np.array([1.0, 0.0, 0.0]))
    shares = []
    for millisecond in range(1, 1000):
        running.advance(millisecond * 1_000_000)
        shares.append(math.acos(rotate(running.truth()["attitude@1"], UP)[2]) / wanted)
    left = 1.0 - np.array([0.0, *shares])
    rise = int(np.argmax(left < 0.1)) - int(np.argmax(left < 0.9))
    delay = 1000 * float(np.trapezoid(left, dx=0.001))
    overshoot = max(0.0, -100 * float(left.min()))
    yield f"tilt: 10 to 90 % in {rise} ms, mean delay {delay:.0f} ms, overshoot {overshoot:.2f} %"


def _integration() -> Iterator[str]:
    """The same commands at 60 and at 480 steps per second."""
    ends = []
    for steps in ("60 Hz", "480 Hz"):
        running = world(2, start={"line": "9 m"}, steps=steps, undisturbed=True).begin()
        path = []
        for frame in range(300):
            running.advance(period_ns(RATE, frame))
            path.append(running.truth()["positions"][:3])
            running.act("1", "thrust", np.array([math.sin(frame / 11.0), math.cos(frame / 7.0), 0.2]))
            running.act("1", "yaw-rate", np.array([math.sin(frame / 20.0)]))
        ends.append(np.array(path))
    off = np.linalg.norm(ends[0] - ends[1], axis=1).max()
    way = np.linalg.norm(np.diff(ends[1], axis=0), axis=1).sum()
    yield f"60 steps a second against 480: at most {1000 * off:.1f} mm apart on a way of {way:.0f} m in 10 s"


def _turbulence() -> Iterator[str]:
    """Two vehicles that nobody steers: how far their relative place goes on a level axis, and how far it should."""
    described = world(400, start={"grid": "30 m"}, imu="none", camera="none")
    running = described.begin()
    before = running.truth()["positions"].reshape(-1, 2, 3)
    for seconds in (1, 2, 5):
        running.advance(seconds * SECOND_NS)
        change = running.truth()["positions"].reshape(-1, 2, 3) - before
        found = (change[:, 0] - change[:, 1])[:, :2].std()
        expected = _expected(described, float(seconds))
        yield f"two vehicles without steering: {found:.2f} m off after {seconds} s, expected {expected:.2f} m"


def _expected(described: FormationWorld, seconds: float) -> float:
    """√2 times the standard deviation of ∫ (1 − e^(−c(t−s)))/c a(s) ds, by the covariance σ² e^(−|s−u|/T) of a."""
    count, drag, turbulence = 1000, described.vehicle.drag, described.turbulence
    times = (np.arange(count) + 0.5) / count * seconds
    weights = -np.expm1(-drag * (seconds - times)) / drag * seconds / count
    covariance = np.exp(-np.abs(times[:, None] - times) / turbulence.correlation)
    return turbulence.acceleration * math.sqrt(2.0 * float(weights @ covariance @ weights))


# -- Who sees whom ------------------------------------------------------------------------------------------------


def sights(described: FormationWorld) -> dict[int, set[int]]:
    """Who is seen by whom in the beginning."""
    running = described.undisturbed().begin()
    rows = {number: running.measure(agent, "camera", 0) for number, agent in enumerate(described.agents)}
    return {seer: set() if found is None else {int(row[0]) for row in found} for seer, found in rows.items()}


def view(axes: Axes) -> Iterator[str]:
    """Six vehicles in plan view, what each one's camera covers, whom it sees, and who is hidden."""
    described = world(6, **SIX)
    camera = described.camera
    assert camera is not None
    seen = sights(described)
    unhidden = sights(replace(described, camera=replace(camera, occlusion=False)))
    half = 0.5 * math.degrees(camera.horizontal)
    for number, ((x, y, _), heading) in enumerate(zip(described.places, described.headings, strict=True)):
        ahead = math.degrees(heading) + 90.0
        axes.add_patch(Wedge((-y, x), 0.9, ahead - half, ahead + half, fc=SKY, alpha=0.35, lw=0))
        axes.add_patch(Circle((-y, x), described.vehicle.radius, fc="white", ec=BLACK, lw=0.8, zorder=3))
        axes.text(-y, x, described.agents[number], ha="center", va="center", zorder=4)
        for other in unhidden[number]:
            _arrow(axes, described, number, other, other in seen[number])
    axes.plot([], [], "-", color=GREEN, label="sees")
    axes.plot([], [], ":", color=VERMILION, label="hidden by another")
    axes.set(aspect="equal", xlabel="east [m]", ylabel="north [m]", title="Six vehicles, each looks at the next one")
    axes.set_xlim(-1.1, 1.1)
    axes.set_ylim(-1.9, 1.9)
    axes.legend(loc="upper center", ncols=2)
    hidden = {number: sorted(unhidden[number] - seen[number]) for number in seen}
    for number, others in seen.items():
        text = f"{described.agents[number]} sees {_names(described, sorted(others))}"
        yield text + (f", {_names(described, hidden[number])} hidden" if hidden[number] else "")


def _arrow(axes: Axes, described: FormationWorld, seer: int, seen: int, visible: bool) -> None:
    """From one vehicle to another, a little to the right, so that both ways stand beside each other."""
    here, there = (np.array([-described.places[each][1], described.places[each][0]]) for each in (seer, seen))
    along = (there - here) / np.linalg.norm(there - here)
    aside = 0.06 * np.array([along[1], -along[0]])
    start, end = here + 0.2 * along + aside, there - 0.21 * along + aside
    colour, dashes = (GREEN, "-") if visible else (VERMILION, ":")
    drawn = {"arrowstyle": "-|>", "linestyle": dashes, "color": colour, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=drawn)


def _names(described: FormationWorld, numbers: list[int]) -> str:
    return " ".join(described.agents[number] for number in numbers) or "nobody"


# -- A manoeuvre that loses sight ---------------------------------------------------------------------------------


class Pilot:
    """Steers to a reference that moves from one shape to another in some time, knowing the truth but for the cameras.

    Each vehicle turns after the next one by a proportional and integral law of where it saw it last, 11 ms late; while
    it does not see it, it does not turn.
    """

    def __init__(self, described: FormationWorld, shapes: tuple[Floats, Floats], over_s: float) -> None:
        self._described, self._shapes, self._over_s = described, shapes, over_s
        self._sums = dict.fromkeys(described.agents, 0.0)

    def reference(self, time_s: float) -> Floats:
        """Where each vehicle is to be about the centre, (N, 3) [m]."""
        share = (
            min(max((time_s - START_S) / self._over_s, 0.0), 1.0) if self._over_s > 0.0 else float(time_s >= START_S)
        )
        first, second = self._shapes
        return np.asarray(first + share * (second - first))

    def steer(self, running: RunningFormation, time_s: float, off: dict[str, float | None]) -> None:
        """Command all vehicles, given how far off the middle of its picture each sees the next one [rad]."""
        truth = running.truth()
        places, velocities = truth["positions"].reshape(-1, 3), truth["velocities"].reshape(-1, 3)
        error = places - places.mean(axis=0) - self.reference(time_s)
        forces = -STIFFNESS * error - DAMPING * (velocities - velocities.mean(axis=0))
        for number, agent in enumerate(self._described.agents):
            back = truth[f"attitude@{agent}"] * [1.0, -1.0, -1.0, -1.0]
            running.act(agent, "thrust", rotate(back, forces[number]))
            angle = off[agent]
            self._sums[agent] += 0.0 if angle is None else angle / RATE
            turn = 0.0 if angle is None else TURN * angle + TURN_SUM * self._sums[agent]
            running.act(agent, "yaw-rate", np.array([turn]))


def flight(over_s: float) -> tuple[Floats, Floats, NDArray[np.bool_], list[dict[str, Any]]]:
    """Vehicle 1 of a triangle flies through between the two others, to the mirrored place.

    Returns:
        Times [s], how far the next one is off the middle of each picture in truth [rad] (frames, 3), whether it is
        seen, and what happened.
    """
    described = world(3, start=BEFORE, camera={"horizontal": "60 deg"})
    pilot = Pilot(described, (read(Formation, BEFORE).of(3), read(Formation, AFTER).of(3)), over_s)
    running = described.begin()
    times, angles, sees, events = [], [], [], []
    for frame in range(round(END_S * RATE)):
        running.advance(period_ns(RATE, frame))
        off = {agent: _seen_off(running, agent, frame) for agent in described.agents}
        times.append(frame / RATE)
        angles.append(_true_off(running, described))
        sees.append([off[agent] is not None for agent in described.agents])
        events += running.events()
        running.advance(period_ns(RATE, frame) + LAG_NS)
        pilot.steer(running, frame / RATE, off)
    return np.array(times), np.array(angles), np.array(sees), events


def _seen_off(running: RunningFormation, agent: str, frame: int) -> float | None:
    """Azimuth of the next vehicle in the picture of one, if it is recognised."""
    rows = running.measure(agent, "camera", frame)
    following = int(agent) % 3
    for row in [] if rows is None else rows.tolist():
        if row[0] == following:
            return math.atan2(row[2], row[1])
    return None


def _true_off(running: RunningFormation, described: FormationWorld) -> list[float]:
    truth = running.truth()
    places = truth["positions"].reshape(-1, 3)
    found = []
    for number, agent in enumerate(described.agents):
        back = truth[f"attitude@{agent}"] * [1.0, -1.0, -1.0, -1.0]
        x, y, _ = rotate(back, places[(number + 1) % 3] - places[number])
        found.append(math.atan2(y, x))
    return found


def passage(axes: Axes) -> Iterator[str]:
    """The same passage as a step and in four seconds: off the middle of the picture of vehicle 1."""
    for over_s, colour in ((0.0, VERMILION), (4.0, BLUE)):
        times, angles, sees, events = flight(over_s)
        name = f"in {over_s:g} s" if over_s else "a step"
        axes.plot(times, np.degrees(angles[:, 0]), color=colour, label=name)
        yield f"{name}: " + "; ".join(_lost(times, sees[:, number], number) for number in range(3))
        yield f"{name}: {sum(event['event'] == 'collision' for event in events)} collisions"
    axes.axhspan(-30.0, 30.0, color=GREY, alpha=0.5, lw=0, label="field of view")
    axes.set(xlabel="time [s]", ylabel="vehicle 2 off the axis of camera 1 [deg]", yticks=range(-120, 91, 30))
    axes.set_ylim(-120.0, 90.0)
    axes.set_title("Vehicle 1 flies through between 2 and 3")
    axes.legend(loc="upper right")


def _lost(times: Floats, sees: NDArray[np.bool_], number: int) -> str:
    """For how long the next vehicle is not recognised at a stretch; single misses do not count."""
    longest, ended, count = 0, 0, 0
    for frame, seen in enumerate(sees.tolist()):
        count = 0 if seen else count + 1
        if count > longest:
            longest, ended = count, frame
    names = f"{number + 1} loses {(number + 1) % 3 + 1}"
    if longest < 3:
        return f"{number + 1} keeps {(number + 1) % 3 + 1}"
    again = "never to see it again" if ended == len(sees) - 1 else f"for {longest / RATE:.1f} s"
    return f"{names} at {times[ended - longest + 1]:.1f} s, {again}"


def main() -> None:
    """Print the numbers that are asked for; `all` draws the figure besides."""
    parser = argparse.ArgumentParser(description="The world of a formation of vehicles.")
    parser.add_argument("which", choices=["motion", "view", "passage", "all"])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images", help="folder of the picture")
    asked = parser.parse_args()
    with style.context(STYLE):
        figure = Figure((PAGE_IN, 3.4), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.7))
        parts: dict[str, Callable[[], Iterator[str]]] = {
            "motion": motion,
            "view": lambda: view(left),
            "passage": lambda: passage(right),
        }
        for name, part in parts.items():
            if asked.which in (name, "all"):
                print(*part(), sep="\n")
        if asked.which == "all":
            asked.out.mkdir(parents=True, exist_ok=True)
            figure.savefig(asked.out / "formation-world.png")


if __name__ == "__main__":
    main()
