"""A running formation: a state machine without a clock, which advances from command to command and step to step.

The state is kept at the last grid step or the last command, whichever is later. Values in between are computed from it
and not kept. The result is therefore the same to the last bit, however often and whenever the formation is advanced,
measured or asked for its truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import Stream, stream
from ...rotation_columns import turned_back
from ...rotations import rotate
from ...units import period_ns
from . import camera
from .air import Swirl, Weather
from .contacts import Contacts
from .formation_description import CAMERA, FormationDescription
from .imu import Units
from .vehicles import Orders, State, accelerations, at_rest, step

Floats = NDArray[np.float64]
COMMANDS = {"thrust": 3, "yaw-rate": 1}
_NEVER_NS = 2**63 - 1


class RunningFormation:
    """The vehicles of a `FormationDescription`, initially at rest."""

    def __init__(self, world: FormationDescription) -> None:
        self._world = world
        self._number = {agent: number for number, agent in enumerate(world.agents)}
        self._now_ns = self._kept_ns = self._step_ns = 0
        self._step = 0
        self._state = _hovering(world)
        self._present: State | None = self._state
        self._view: camera.View | None = None
        self._samples: dict[tuple[str, int], list[Floats | None]] = {}
        count = len(world.agents)
        self._orders = Orders(np.zeros((3, count)), np.zeros((3, count)), np.zeros(count))
        self._until = {command: np.full(count, _NEVER_NS) for command in COMMANDS}
        self._due_ns: int = _NEVER_NS
        for number in range(count):
            self._aim(number, np.zeros(3))
        self._swirl = Swirl(world.turbulence, world.seed, world.agents)
        self._weather = Weather(world.gusts, world.seed)
        imu = world.imu
        self._units = None if imu is None else Units(imu, world.seed, world.agents)
        self._field = np.zeros((3, 1)) if imu is None else imu.field[:, None]
        self._draws: dict[tuple[int, int], Stream] = {}
        self._contacts = Contacts(world)

    def advance(self, time_ns: int) -> None:
        """Advance to an instant.

        Raises:
            BadInput: it is before the present one.
        """
        if time_ns < self._now_ns:
            raise BadInput(f"the world is at {self._now_ns} ns and cannot go back to {time_ns} ns")
        if time_ns == self._now_ns:
            return
        self._now_ns, self._present, self._view, self._samples = time_ns, None, None, {}
        while (next_ns := period_ns(self._world.steps, self._step + 1)) <= time_ns:
            self._settle(next_ns)
            self._swirl.advance(next_ns - self._step_ns)
            self._step, self._step_ns = self._step + 1, next_ns
            if next_ns >= self._due_ns:
                self._time_out(next_ns)
            self._contacts.look(self._state.places, next_ns)

    def act(self, agent: str, command: str, value: Floats) -> None:
        """Apply a command now; it holds until the next one of its kind or the command timeout.

        - "thrust" (3,): the wanted force [N] in addition to the compensation of the weight, in body coordinates.
          It is kept in inertial coordinates, within the limits of the vehicle.
        - "yaw-rate" (1,): about the body's z axis [rad/s].

        Raises:
            BadInput: no such vehicle or command, another number of values, or one that is not finite.
        """
        number = self._numbered(agent)
        if command not in COMMANDS:
            raise BadInput(f"vehicle {agent} knows no command {command!r}: it obeys {', '.join(COMMANDS)}")
        if value.shape != (COMMANDS[command],) or not all(map(math.isfinite, value.tolist())):
            raise BadInput(f"command {command} to vehicle {agent} takes {COMMANDS[command]} finite values, not {value}")
        self._settle(self._now_ns)
        self._samples = {}
        until_ns = self._now_ns + self._world.vehicle.command_timeout_ns
        self._until[command][number] = until_ns
        self._due_ns = min(self._due_ns, until_ns)
        if command == "thrust":
            self._aim(number, rotate(self._state.attitudes[:, number], value))
        else:
            self._orders.yaw_rates[number] = value[0]

    def measure(self, agent: str, sensor: str, index: int) -> Floats | None:
        """The sensor's index-th sample, taken now.

        - "camera": a row for each vehicle that is recognised, (n, 8): its index in natural order, its place in the
          camera's body coordinates [m], its attitude relative to the camera's as a quaternion; None if there is none.
        - "imu": body rates [rad/s], specific force [m/s²] and magnetic field (of length 1), (9,).

        Raises:
            BadInput: no such vehicle or sensor.
        """
        number = self._numbered(agent)
        if (sensor, index) not in self._samples:
            if sensor not in self._world.sensors(agent):
                known = ", ".join(self._world.sensors(agent)) or "none"
                raise BadInput(f"vehicle {agent} has no sensor {sensor!r}: it has {known}")
            self._samples[sensor, index] = self._frames(index) if sensor == CAMERA else list(self._felt(index))
        sample = self._samples[sensor, index][number]
        return None if sample is None else sample.copy()

    def truth(self) -> Mapping[str, Floats]:
        """The true quantities now.

        "positions" (3 N,) [m] and "velocities" (3 N,) [m/s], vehicle by vehicle; "formation" (6 (N − 1),), the relative
        state [r₁, ṙ₁, r₂, ṙ₂, …] with r_i = p_i − p_(i+1); "centre" (3,) [m]; "attitude@NAME" (4,), a quaternion.
        """
        state = self._seen_now()
        relative = np.concatenate((state.places, state.velocities))
        return {
            "positions": state.places.T.ravel(),
            "velocities": state.velocities.T.ravel(),
            "formation": (relative[:, :-1] - relative[:, 1:]).T.ravel(),
            "centre": state.places.mean(axis=1),
            **{f"attitude@{agent}": state.attitudes[:, number].copy() for agent, number in self._number.items()},
        }

    def events(self) -> list[dict[str, Any]]:
        """Contacts that began or ended since the last call, found at the steps of the integration."""
        return self._contacts.told()

    def _settle(self, time_ns: int) -> None:
        """Keep the state of an instant."""
        if time_ns > self._kept_ns:
            self._state = self._stepped(time_ns)
            self._kept_ns = time_ns
            self._weather.forget(time_ns)

    def _stepped(self, time_ns: int) -> State:
        disturbance = self._swirl.value + self._weather.mean(self._kept_ns, time_ns)[:, None]
        return step(self._world.vehicle, self._state, self._orders, disturbance, time_ns - self._kept_ns)

    def _seen_now(self) -> State:
        if self._present is None:
            self._present = self._state if self._kept_ns == self._now_ns else self._stepped(self._now_ns)
        return self._present

    def _time_out(self, time_ns: int) -> None:
        for command, until in self._until.items():
            late = until <= time_ns
            until[late] = _NEVER_NS
            for number in np.flatnonzero(late).tolist():
                if command == "thrust":
                    self._aim(number, np.zeros(3))
                else:
                    self._orders.yaw_rates[number] = 0.0
        self._due_ns = min(int(until.min()) for until in self._until.values())

    def _aim(self, number: int, force: Floats) -> None:
        thrust = self._world.vehicle.thrust(force)
        length = math.hypot(*thrust.tolist())
        self._orders.thrusts[:, number] = thrust
        self._orders.directions[:, number] = thrust / length if length > 0.0 else (0.0, 0.0, 1.0)

    def _frames(self, index: int) -> list[Floats | None]:
        assert self._world.camera is not None
        if self._view is None:
            state = self._seen_now()
            self._view = camera.view(self._world.camera, self._world.vehicle.radius, state.places, state.matrices)
        return camera.frames(self._world.camera, self._view, self._seen_now().attitudes, index, self._pair)

    def _felt(self, index: int) -> Floats:
        assert self._units is not None
        state = self._seen_now()
        gust = self._weather.mean(self._now_ns, self._now_ns)[:, None]
        forces = accelerations(self._world.vehicle, state, self._orders, self._swirl.value + gust)
        turned_in = turned_back(state.matrices, forces), turned_back(state.matrices, self._field)
        return self._units.samples(state.rates, *turned_in, index)

    def _pair(self, seer: int, seen: int) -> Stream:
        if (seer, seen) not in self._draws:
            agents = self._world.agents
            self._draws[seer, seen] = stream(self._world.seed, "camera noise", agents[seer], agents[seen])
        return self._draws[seer, seen]

    def _numbered(self, agent: str) -> int:
        if agent not in self._number:
            raise BadInput(f"agent {agent!r} is no vehicle of the formation: it has {', '.join(self._number)}")
        return self._number[agent]


def _hovering(world: FormationDescription) -> State:
    half = 0.5 * np.array(world.headings)
    attitudes = np.array((np.cos(half), np.zeros_like(half), np.zeros_like(half), np.sin(half)))
    return at_rest(np.array(world.places).T.copy(), attitudes)
