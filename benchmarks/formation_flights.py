"""The world of a formation alone: vehicles under control, with cameras and inertial measurement units."""

from __future__ import annotations

import math
import time

import numpy as np

from volery.topologies import Formation
from volery.units import period_ns
from volery.worlds.formation.air import Turbulence
from volery.worlds.formation.formation_settings import FormationSettings

RATE_HZ = 30.0
LAG_NS = 11_000_000


def flight(vehicles: int, seconds: float) -> dict[str, float]:
    """Processor time per nominal second, in milliseconds; every vehicle is in view of some other."""
    agents = [str(number) for number in range(1, vehicles + 1)]
    world = FormationSettings(start=Formation(grid=1.5), turbulence=Turbulence(acceleration=0.0)).build({}, 1, agents)
    running = world.begin()
    seen = 0
    start = time.process_time()
    for frame in range(round(seconds * RATE_HZ)):
        running.advance(period_ns(RATE_HZ, frame))
        for agent in agents:
            rows = running.measure(agent, "camera", frame)
            running.measure(agent, "imu", frame)
            seen += 0 if rows is None else len(rows)
        running.truth()
        running.events()
        running.advance(period_ns(RATE_HZ, frame) + LAG_NS)
        force = np.array([0.2 * math.sin(frame / 5.0), 0.2 * math.cos(frame / 5.0), 0.0])
        for agent in agents:
            running.act(agent, "thrust", force)
            running.act(agent, "yaw-rate", np.array([0.1 * math.sin(frame / 5.0)]))
    spent = time.process_time() - start
    return {"ms_per_second": 1000.0 * spent / seconds, "seen": seen / (seconds * RATE_HZ * vehicles)}
