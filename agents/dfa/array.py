"""What makes an array of modules unfit for its estimators."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from ...estimators.flying_array.least_squares import noncollinear
from ...topologies import natural_key
from ...transport.links import LinkSettings
from ...transport.media import earliest_start
from ...transport.media_settings import EDGE_SLOTS, FullDuplex
from ...units import period_ns
from ..plan import Plan
from .dfa_settings import DfaParameters

SENSOR = "distance"
_ROUNDS_LOOKED_AT = 240


def problems(plan: Plan) -> Sequence[str]:
    """What makes a plan impossible for flying-array modules, each a sentence with the remedy."""
    positions = [agent.position for agent in plan.agents if agent.position is not None]
    if plan.world is None:
        return ["dfa-module needs a world to look at: add `world: {kind: plane, …}`"]
    if not plan.is_uniform:
        return ["the modules of a flying array are all alike: remove `only` from agents"]
    if len(positions) < len(plan.agents):
        return ["dfa-module needs positions: use a topology that has them, such as hexagonal or cells"]
    if not noncollinear(positions):
        return ["the modules are on one line, so roll and pitch cannot be told apart: add a cell off the line"]
    return list(chain(_other_rates(plan), _unsteady(plan), _late_rounds(plan)))


def _unsteady(plan: Plan) -> Iterator[str]:
    if plan.presence and any(agent.parameters.timing == "asynchronous" for agent in plan.agents):
        yield (
            "asynchronous estimators remember what each neighbour was told, so the graph must not change: "
            "use timing: synchronous, whose rounds begin anew with each sample"
        )


def _other_rates(plan: Plan) -> Iterator[str]:
    assert plan.world is not None
    for agent in plan.agents:
        rate = plan.world.sensors(agent.name).get(SENSOR)
        if rate != agent.parameters.rate:
            yield (
                f"agents.rate is {agent.parameters.rate:g} Hz, but the world's sensors run at {rate or 0:g} Hz: "
                "make them equal"
            )
            return


def _late_rounds(plan: Plan) -> Iterator[str]:
    """Synchronous rounds whose frames, at mean latency, come after the round in which they are used is over."""
    kinds = {
        (
            agent.parameters,
            agent.compute_ns,
            plan.links[agent.name, other],
            natural_key(agent.name) > natural_key(other),
        )
        for agent in plan.agents
        for other in agent.neighbours
        if agent.parameters.timing == "synchronous"
    }
    worst_ns = max((_behind(plan, *kind) for kind in kinds), default=0)
    if worst_ns > 0:
        yield (
            f"synchronous rounds do not fit: a frame of mean latency comes {worst_ns / 1e6:.3f} ms after the round "
            "that waits for it; use fewer rounds, less latency, a smaller payload, "
            "phase: aligned, or timing: asynchronous"
        )


def _behind(plan: Plan, parameters: DfaParameters, compute_ns: int, settings: LinkSettings, second: bool) -> int:
    """How long after the end of its round a link's latest frame comes, in nanoseconds; negative if all are early."""
    airtime_ns = settings.airtime_ns(parameters.largest_payload)
    latest = -(2**62)
    total = int(plan.duration_ns * parameters.round_rate / 1e9)
    for number in range(min(total, _ROUNDS_LOOKED_AT)):
        for phase_ns in (0, parameters.spread_ns()):
            ready_ns = period_ns(parameters.round_rate, number) + phase_ns + compute_ns
            start_ns = ready_ns
            if not isinstance(settings.medium, FullDuplex):
                start_ns = earliest_start(settings.medium.access, ready_ns, airtime_ns, int(second), EDGE_SLOTS)
            due_ns = start_ns + airtime_ns + int(settings.latency.mean_ns)
            latest = max(latest, due_ns - period_ns(parameters.round_rate, number + 1))
    return latest
