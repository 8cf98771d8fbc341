"""Problems that keep vehicles from flying as a formation, each a sentence with the remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from ...errors import BadInput
from ...estimators.formation.assignment import check_observable
from ...estimators.frames.so3_consensus import check_step
from ...units import SampleTimes
from ..plan import Plan
from .mav_samples import CAMERA, IMU
from .mav_settings import MavParameters


def problems(plan: Plan) -> Sequence[str]:
    """Problems of a plan whose agents are vehicles."""
    if not plan.is_uniform:
        return ["the vehicles of a formation are all alike: remove `only` from agents"]
    world = plan.coupled
    if world is None:
        return ["mav needs a world that it can fly in: add `world: {kind: formation}`"]
    parameters: MavParameters = plan.agents[0].parameters
    names = tuple(agent.name for agent in plan.agents)
    sensors = world.sensors(names[0])
    if CAMERA not in sensors or IMU not in sensors:
        return [f"mav needs a camera and an imu, and this world has {', '.join(sensors) or 'no sensors'}"]
    checks = (_rates(parameters, sensors[CAMERA]), _delays(plan, parameters))
    return [*(text for found in checks for text in found), *_refusals(parameters, names)]


def _rates(parameters: MavParameters, camera: SampleTimes) -> Iterator[str]:
    if parameters.rate != camera:
        has = f"{camera:g} Hz" if isinstance(camera, float) else "instants of its own"
        yield f"rate is {parameters.rate:g} Hz and the camera has {has}: make them the same"


def _delays(plan: Plan, parameters: MavParameters) -> Iterator[str]:
    """Problem of messages older than the history of forces, which cannot be propagated."""
    if parameters.filtering.delay == "ignore":
        return
    oldest_ns = max(settings.lookahead_ns() for settings in plan.links.values()) if plan.links else 0
    if oldest_ns >= parameters.filtering.history:
        yield (
            f"messages are older than {oldest_ns / 1e6:g} ms and filtering.history is "
            f"{parameters.filtering.history / 1e6:g} ms, so none could be used: make it longer"
        )


def _refusals(parameters: MavParameters, names: tuple[str, ...]) -> Iterator[str]:
    """Parameters that the parts of a vehicle refuse."""

    def observable() -> None:
        check_observable(len(names), parameters.tracked(names).items(), names)

    def converges() -> None:
        if parameters.frames.consensus:
            tracked = parameters.tracked(names)
            weights = {names[number]: {names[seen]: 1.0} for number, seen in tracked.items()}
            check_step(parameters.frames.step, weights, parameters.frames.anchor)

    checks: tuple[Callable[[], object], ...] = (
        lambda: parameters.states(len(names)),
        observable,
        converges,
        lambda: parameters.messages.layout(len(names)).check_fits(parameters.messages.packet),
        parameters.filtering.settings,
        lambda: parameters.model(len(names)),
    )
    for check in checks:
        try:
            check()
        except BadInput as error:
            yield str(error)
