"""Five robots localise themselves by ranges to two anchors and to each other; a central filter has all they measure."""

from dataclasses import dataclass

import numpy as np

from volery.agents import agent, payloads
from volery.experiments.evaluation.evaluation import Evaluation
from volery.quantities import Component, Quantity
from volery.units import Metres
from volery.worlds.world import World


@dataclass(frozen=True)
class Noise:
    range: Metres = 0.1
    drive: Metres = 0.02


class Yard(World):
    Parameters = Noise
    quantities = (Quantity("place", (Component("x", "m"), Component("y", "m")), is_shared=False),)
    model = property(lambda self: self.parameters)  # the data sheet
    anchors = np.array([[0.0, 0.0], [12.0, 0.0]])

    def position(self, agent, time_ns):  # on circles beside each other
        number, turn = self.agents.index(agent), 0.3e-9 * time_ns
        return np.array([2 + 2 * number + 1.5 * np.cos(turn + number), 5 + 1.5 * np.sin(turn + number)])

    def truth(self, agent, quantity, time_ns):
        return self.position(agent, time_ns)

    def sensors(self, agent):
        return {"drive": 5.0, "range": 5.0}

    def measure(self, agent, sensor, index, time_ns):
        here, noise = self.position(agent, time_ns), np.array(self.random(sensor, agent).normals(2 * index, 2))
        moved = here - self.position(agent, time_ns - 200_000_000) + self.parameters.drive * noise
        ranges = np.hypot(*(self.anchors - here).T) + self.parameters.range * noise
        return moved if sensor == "drive" else [*enumerate(ranges)]  # of ranges a row for each anchor

    def measure_frame(self, source, target, time_ns, noise):
        apart = self.position(source, time_ns) - self.position(target, time_ns)
        return np.hypot(*apart) + self.parameters.range * noise.normal(0)


class PlaceFilter:  # an extended Kalman filter of the places of one robot, or of all; at first nobody knows where it is
    def __init__(self, noise, count):
        self.noise, self.mean, self.cov = noise, np.tile([6.0, 5.0], count), 4.0 * np.eye(2 * count)

    def sampled(self, mine, sample):
        if sample.sensor == "drive":
            self.mean[mine] += 0.0 if sample.value is None else sample.value
            self.cov[mine, mine] += self.noise.drive**2 * np.eye(2)
        for anchor, far in sample.value if sample.sensor == "range" and sample.value is not None else ():
            self.ranged(mine, far, Yard.anchors[int(anchor)])

    def ranged(self, mine, far, place, cov=(0.0, 0.0, 0.0, 0.0), other=slice(0)):
        apart, row = self.mean[mine] - place, np.zeros(len(self.mean))
        row[mine] = along = apart / np.hypot(*apart)
        row[other] = -along[: len(row[other])]
        gain = self.cov @ row / (row @ self.cov @ row + along @ np.reshape(cov, (2, 2)) @ along + self.noise.range**2)
        self.mean, self.cov = self.mean + gain * (far - np.hypot(*apart)), self.cov - np.outer(gain, row @ self.cov)


class Central(Evaluation):
    needs_payloads = True

    def __init__(self, *given):
        super().__init__(*given)
        self.parts = {agent.name: slice(2 * k, 2 * k + 2) for k, agent in enumerate(self.plan.agents)}
        self.filter = PlaceFilter(self.plan.public.model, len(self.parts))

    def sampled(self, agent, sample):
        self.filter.sampled(self.parts[agent], sample)

    def received(self, agent, frame):
        mine, other = self.parts[agent], self.parts[frame.source]
        self.filter.ranged(mine, frame.measured[0], self.filter.mean[other], other=other)

    def central_estimate(self, agent, quantity, index, time_ns):
        mine = self.parts[agent]
        return {"place": self.filter.mean[mine], "place/covariance": self.filter.cov[mine, mine]}.get(quantity)


class Robot(agent.Agent):
    evaluation = Central
    briefing = classmethod(lambda cls, plan, name: plan.model)

    def start(self):
        self.filter = PlaceFilter(self.context.briefing, 1)

    def on_sample(self, sample):
        self.filter.sampled(slice(2), sample)
        if sample.sensor == "range":
            self.context.report("place", self.filter.mean, sample.index, covariance=self.filter.cov)
            self.context.broadcast(payloads.encode([self.filter.mean, self.filter.cov.ravel()]))

    def on_frame(self, frame):
        self.filter.ranged(slice(2), frame.measured[0], *payloads.decode(frame.payload))
