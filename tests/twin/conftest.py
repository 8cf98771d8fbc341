"""Plans of agents that talk, and one way to run a plan in the twin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from volery.agents.agent import Agent
from volery.agents.plan import AgentPlan, Plan, World
from volery.experiments.record.record import Record
from volery.experiments.scenario.slots import radio_slots
from volery.experiments.twin import recorded
from volery.transport.faults import ClockFault, Fault, Kill, LinkFault, Pause
from volery.transport.latency_settings import Constant, Gamma, LatencyTrace, LogNormal, Normal, Pareto, Uniform
from volery.transport.links import Bucket, LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli, BitError, Frames, GilbertElliott, GilbertElliottTime, LossTrace
from volery.transport.media_settings import Aloha, Csma, FullDuplex, HalfDuplex, SlottedAloha, Tdma

from .talking import Answerer, Probe, Talker, TalkerParameters

MS = 1_000_000
PlanOf = Callable[..., Plan]
Run = Callable[[Plan], Record]

DRAWN_MS = 200


def kind_of(agent: type[Agent]) -> str:
    """How a plan names a class of these tests."""
    return f"{agent.__module__}:{agent.__qualname__}"


def _plan(  # noqa: PLR0913 - what a plan has
    edges: Sequence[tuple[str, str]],
    kind: type[Agent] = Talker,
    settings: LinkSettings | Mapping[tuple[str, str], LinkSettings] | None = None,
    faults: Sequence[Fault] = (),
    duration_ms: int = 300,
    *,
    parameters: Mapping[str, Any] | None = None,
    compute_ns: int = MS,
    seed: int = 7,
    world: World | None = None,
) -> Plan:
    pairs = [link for a, b in edges for link in ((a, b), (b, a))]
    common = LinkSettings(latency=Constant(5 * MS)) if settings is None else settings
    links = {link: common if isinstance(common, LinkSettings) else common[link] for link in pairs}
    names = sorted({source for source, _ in pairs}, key=int)
    near = {name: tuple(sorted((b for a, b in pairs if a == name), key=int)) for name in names}
    degrees = {name: len(others) for name, others in near.items()}
    default = TalkerParameters() if issubclass(kind, Talker) else None
    agents = tuple(
        AgentPlan(name, kind_of(kind), (parameters or {}).get(name, default), near[name], degrees, None, compute_ns)
        for name in names
    )
    return Plan("talk", seed, duration_ms * MS, agents, links, world, tuple(faults))


def _one(rng: np.random.Generator, *choices: Any) -> Any:
    return choices[rng.integers(len(choices))]


def _medium(rng: np.random.Generator) -> Any:
    tdma = Tdma(_one(rng, 60.0, 90.0, 100.0), int(rng.integers(0, 400_000)))
    return _one(rng, FullDuplex(), HalfDuplex(access=Aloha()), HalfDuplex(access=tdma))


def _latency(rng: np.random.Generator) -> Any:
    low = int(rng.integers(MS // 2, 8 * MS))
    smooth = _one(rng, Uniform(low, low + 3 * MS), Normal(low, low // 4), Gamma(low, low // 2, correlation=0.7))
    heavy = _one(rng, LogNormal(low, low // 2), Pareto(low, 3.0), LatencyTrace((0, 30 * MS), (low, MS), 70 * MS))
    return _one(rng, Constant(0), Constant(low), smooth, heavy)


def _rate(rng: np.random.Generator) -> Any:
    return _one(rng, None, 115_200.0, 250_000.5, 1e6)


def _loss(rng: np.random.Generator) -> Any:
    in_time = _one(rng, GilbertElliottTime(30 * MS, 10 * MS, 0.9), LossTrace((0, 40 * MS), (0.1, 0.6), 90 * MS))
    return _one(rng, (), (Bernoulli(0.3, 0.5),), (GilbertElliott(0.2, 0.4), Frames((2,))), (in_time, BitError(1e-3)))


def _settings(rng: np.random.Generator, medium: Any) -> LinkSettings:
    return LinkSettings(
        medium=medium,
        rate=_rate(rng),
        overhead=int(rng.integers(0, 5)),
        queue=Queue(int(rng.integers(1, 5)), _one(rng, "drop-tail", "drop-head", "latest")),
        loss=_loss(rng),
        duplication=_one(rng, 0.0, 0.3),
        latency=_latency(rng),
    )


def _edges(rng: np.random.Generator) -> list[tuple[str, str]]:
    """A random tree of two to five agents, and perhaps one edge more."""
    count = int(rng.integers(2, 6))
    edges = [(str(int(rng.integers(1, late))), str(late)) for late in range(2, count + 1)]
    extra = tuple(str(end) for end in sorted(rng.choice(np.arange(1, count + 1), 2, replace=False)))
    return edges if extra in edges else [*edges, (extra[0], extra[1])]


def _faults(rng: np.random.Generator, edges: list[tuple[str, str]]) -> list[Fault]:
    """Changes of everything that shapes a promise, and pauses; on whole milliseconds, so that instants coincide."""
    faults: list[Fault] = []
    for number in range(int(rng.integers(0, 6))):
        at = int(rng.integers(0, DRAWN_MS)) * MS
        until = None if rng.random() < 0.3 else at + int(rng.integers(1, 60)) * MS
        a, b = edges[rng.integers(len(edges))]
        changes = _one(
            rng,
            {"latency": _latency(rng)},
            {"rate": _rate(rng)},
            {"medium": _medium(rng)},
            {"rate": _rate(rng), "latency": _latency(rng), "loss": _loss(rng)},
            {"cut": True},
            None,
        )
        if changes is None:
            faults.append(Pause(f"t{number}", at, until or at + 20 * MS, a))
        else:
            faults.append(LinkFault(f"t{number}", at, until, ((a, b), (b, a)), changes))
    return faults


def _radio_links(rng: np.random.Generator, edges: list[tuple[str, str]]) -> dict[tuple[str, str], LinkSettings]:
    """Links over one radio each: what a radio has is alike, loss and latency are each link's own."""
    access = _one(rng, Aloha(), SlottedAloha(4 * MS), Tdma(40.0, int(rng.integers(0, 400_000))), Csma())
    common = replace(_settings(rng, HalfDuplex("node", access)), rate=_one(rng, 250_000.5, 1e6))
    return {
        link: replace(common, loss=_loss(rng), latency=_latency(rng), duplication=_one(rng, 0.0, 0.3))
        for edge in edges
        for link in (edge, edge[::-1])
    }


def _radio_faults(rng: np.random.Generator, edges: list[tuple[str, str]]) -> list[Fault]:
    """Changes of single links, clocks that are wrong, and pauses."""
    faults: list[Fault] = []
    for number in range(int(rng.integers(0, 6))):
        at = int(rng.integers(0, DRAWN_MS)) * MS
        until = None if rng.random() < 0.3 else at + int(rng.integers(1, 60)) * MS
        edge = edges[rng.integers(len(edges))]
        changes = _one(rng, {"latency": _latency(rng)}, {"loss": _loss(rng)}, {"cut": True}, {"hold": True}, None)
        if changes is not None:
            faults.append(LinkFault(f"t{number}", at, until, (edge, edge[::-1]), changes))
        elif rng.random() < 0.5:
            faults.append(Pause(f"t{number}", at, until or at + 20 * MS, edge[0]))
        else:
            offset, drift = int(rng.integers(-9, 10)) * MS, int(rng.integers(-(10**8), 10**8))
            faults.append(ClockFault(f"t{number}", at, until, edge[0], offset, drift))
    return faults


def _draw_radio(kind: type[Agent], seed: int) -> Plan:
    rng = np.random.default_rng(seed)
    edges = _edges(rng)
    links = _radio_links(rng, edges)
    names = sorted({name for edge in edges for name in edge})
    phases = {name: int(rng.integers(0, 20)) * MS // 2 for name in names}
    parameters = {name: TalkerParameters(_one(rng, 20.0, 30.0, 50.0), phase, True) for name, phase in phases.items()}
    faults, world = _radio_faults(rng, edges), _one(rng, None, Probe())
    plan = _plan(edges, kind, links, faults, DRAWN_MS, parameters=parameters, seed=seed, world=world)
    return replace(plan, slots=radio_slots(plan.links))


def _mortal(plan: Plan, seed: int) -> Plan:
    rng = np.random.default_rng(seed)
    kills = []
    for agent in plan.agents:
        at, deaths = int(rng.integers(0, DRAWN_MS)), int(rng.integers(0, 4))
        for left in reversed(range(deaths)):
            until = at + int(rng.integers(1, 60))
            end = until * MS if left or rng.random() < 0.7 else None
            kills.append(Kill(f"k{agent.name}.{left}", at * MS, end, agent.name, bool(rng.integers(2))))
            at = until + int(rng.integers(0, 40))
    return replace(plan, faults=(*plan.faults, *kills))


@pytest.fixture
def mortal() -> Callable[[Plan, int], Plan]:
    """Let agents of a plan die and come back, some of them several times, at whole milliseconds."""
    return _mortal


def _draw(kind: type[Agent], seed: int) -> Plan:
    rng = np.random.default_rng(seed)
    edges = _edges(rng)
    media = {edge: _medium(rng) for edge in edges}
    links = {link: _settings(rng, medium) for edge, medium in media.items() for link in (edge, (edge[1], edge[0]))}
    names = sorted({name for edge in edges for name in edge})
    phases = {name: int(rng.integers(0, 20)) * MS // 2 for name in names}
    parameters = {name: TalkerParameters(_one(rng, 20.0, 30.0, 50.0), phase) for name, phase in phases.items()}
    faults = _faults(rng, edges)
    compute_ns, world = _one(rng, 200_000, MS, 3 * MS), _one(rng, None, Probe())
    return _plan(
        edges, kind, links, faults, DRAWN_MS, parameters=parameters, compute_ns=compute_ns, seed=seed, world=world
    )


@pytest.fixture
def drawn_plan() -> Callable[..., Plan]:
    """Draw a plan of a kind: graph, media, rates, latencies, losses, queues, phases, faults."""
    return _draw


def _come_and_go(plan: Plan, seed: int) -> Plan:
    rng = np.random.default_rng(seed)
    presence = {}
    for first, second in plan.links:
        if first < second and rng.random() < 0.7:
            instants = np.unique(rng.integers(0, DRAWN_MS, 2 * rng.integers(1, 4))) * MS
            ends = [*instants.tolist(), plan.duration_ns][: 2 * (len(instants) // 2 + len(instants) % 2)]
            spans = tuple(zip(ends[::2], ends[1::2], strict=True))
            presence[first, second] = presence[second, first] = spans
    return replace(plan, presence=presence)


@pytest.fixture
def come_and_go() -> Callable[[Plan, int], Plan]:
    """Let most edges of a plan come and go, at whole milliseconds."""
    return _come_and_go


def _with_buckets(plan: Plan, seed: int) -> Plan:
    rng = np.random.default_rng(seed)
    bucket = Bucket(float(_one(rng, 4000.0, 20_000.0, 100_000.5)), int(rng.integers(50, 120)))
    return replace(plan, links={link: replace(settings, bucket=bucket) for link, settings in plan.links.items()})


@pytest.fixture
def with_buckets() -> Callable[[Plan, int], Plan]:
    """Put one token bucket, as it is drawn, on every link of a plan."""
    return _with_buckets


@pytest.fixture
def radio_plan() -> Callable[..., Plan]:
    """Draw a plan of a kind whose agents have one radio each, with wrong clocks and links that hold frames back."""
    return _draw_radio


@pytest.fixture(name="plan_of")
def plan_of_fixture() -> PlanOf:
    """Make a plan: `plan_of(edges, kind, settings, faults, duration_ms, parameters=…, compute_ns=…, …)`."""
    return _plan


@pytest.fixture
def twin_run() -> Run:
    """Run a plan in the twin and give its record."""
    return recorded


@pytest.fixture
def talker() -> type[Agent]:
    """An agent that talks on timers and samples only."""
    return Talker


@pytest.fixture
def answerer() -> type[Agent]:
    """An agent that answers the frames that it gets."""
    return Answerer


@pytest.fixture(params=["talker", "answerer"])
def who(request: pytest.FixtureRequest) -> type[Agent]:
    """Both, one after the other."""
    kind: type[Agent] = request.getfixturevalue(request.param)
    return kind


@pytest.fixture(params=["drawn_plan", "radio_plan"])
def any_plan(request: pytest.FixtureRequest) -> PlanOf:
    """Draw a plan of a kind: without radios and with them, one after the other."""
    draw: PlanOf = request.getfixturevalue(request.param)
    return draw


@pytest.fixture
def probe() -> World:
    """A world with one sensor for each agent."""
    return Probe()


@pytest.fixture
def parameters_of() -> Callable[..., TalkerParameters]:
    """Make the parameters of a talker."""
    return TalkerParameters
