"""The fields of a scenario file, and the scenario that they make."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field, fields, replace
from functools import cache, partial
from typing import Annotated, Any

from pydantic import TypeAdapter
from ruamel.yaml import YAML

from ...agents.plan import MILLISECOND_NS
from ...agents.registry import AGENTS
from ...errors import BadInput
from ...names import LONGEST_RUN, check_length
from ...topologies.over_time import Topology
from ...units import Bounds, Duration, Period, quantity, within_bounds
from ...worlds.world_kinds import AnyWorld
from .dumping import dumped, settings
from .fault_places import Groups, Words
from .link_schema import Links, LinksText
from .settings_reading import (
    TAG,
    Check,
    Reader,
    any_of,
    given,
    model_fields,
    model_of,
    own_kind,
    read_fields,
    tagged,
    typed,
)
from .strict_reading import read_model
from .timeline import FaultEntry

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


def _not_negative(compute_ns: int) -> int:
    if compute_ns < 0:
        raise BadInput(f"compute is {quantity(compute_ns, 'ns')}, it must be at least 0")
    return compute_ns


@dataclass(frozen=True)
class AgentKind:
    """What runs in agents: a kind, its parameters, and the nominal time from an event to the frames that it causes."""

    kind: str
    parameters: Any
    compute: int = MILLISECOND_NS


@dataclass(frozen=True)
class SomeAgents(AgentKind):
    """Another kind for some agents; `where` as in faults, later entries take precedence."""

    where: tuple[str, ...] = ()


@dataclass(frozen=True)
class Agents(AgentKind):
    """The kind of all agents and, under `only`, that of some."""

    only: tuple[SomeAgents, ...] = ()


@dataclass(frozen=True)
class _EveryKind:
    """Fields besides the parameters of a kind.

    compute: nominal time from an event to the frames that the agent sends because of it.
    """

    compute: Annotated[Duration, Check(_not_negative)] = MILLISECOND_NS


@dataclass(frozen=True)
class _Some(_EveryKind):
    """Fields of an entry under `only`.

    where: agents, as in faults.
    """

    where: Words = field(kw_only=True)


def _read_agents(made: Any, beside: Any, value: Any) -> Any:
    """A kind with its parameters and the other fields of the mapping."""
    kind, body = tagged(AGENTS, value)
    parameters = AGENTS.find(kind).Parameters
    values = given(read_model(model_of(parameters, tag=kind, beside=beside), {TAG: kind, **body}))
    own = beside(**{field.name: values.pop(field.name) for field in fields(beside) if field.name in values})
    return made(kind=kind, parameters=within_bounds(parameters(**values)), **vars(own))


def _agents_text(beside: Any) -> Any:
    """The type of every kind with its fields; a kind of a user's own may have any fields."""
    shapes = [model_of(AGENTS.find(name).Parameters, tag=name, beside=beside) for name in AGENTS.names()]
    return any_of([*shapes, own_kind(**model_fields(beside))])


def _dumped_kind(beside: Any, agents: AgentKind) -> dict[str, Any]:
    own = {name: dumped(getattr(agents, name), hint) for name, (hint, _) in read_fields(beside).items()}
    return {TAG: agents.kind, **own, **dumped(agents.parameters)}


def _agents_reader(made: Any, beside: Any) -> Reader:
    return Reader(
        partial(_read_agents, made, beside),
        partial(_agents_text, beside),
        partial(_dumped_kind, beside),
    )


@dataclass(frozen=True)
class _All(_EveryKind):
    """Fields of `agents`.

    only: other kinds for some agents.
    """

    only: tuple[Annotated[SomeAgents, _agents_reader(SomeAgents, _Some)], ...] = ()


def _name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise BadInput(f"{name!r} cannot name a run: use letters, digits, '_', '-' and '.', a letter or digit first")
    return check_length(name, LONGEST_RUN, "the name")


def _lasting(duration_ns: int) -> int:
    if duration_ns <= 0:
        raise BadInput(f"duration is {quantity(duration_ns, 'ns')}, it must be above 0: write for example 10 s")
    return duration_ns


def _seed(seed: int) -> int:
    if seed < 0:
        raise BadInput(f"seed is {seed}, it must be at least 0")
    return seed


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A scenario, validated field by field; `compile_plan` checks that its parts fit together.

    name: name of the run's folder; by default the name of the file.
    duration: nominal length of the run.
    topology: who is a neighbour of whom.
    agents: what runs in each agent.
    paper: for readers: the paper that is reproduced.
    description: for readers: what the scenario shows.
    seed: seed of every random draw.
    world: the truth, and the sensors that look at it.
    groups: names for sets of agents, as in {left: [1, 2, 3]}, usable wherever agents and links are named.
    links: settings of all links, and changes for some.
    faults: what changes, where, from when to when.
    overload: whether media may be offered more than they can carry.
    """

    name: Annotated[str, Check(_name)]
    paper: str = ""
    description: str = ""
    seed: Annotated[int, Check(_seed), Bounds(least=0)] = 0
    duration: Annotated[Period, Check(_lasting)]
    topology: Topology
    agents: Annotated[Agents, _agents_reader(Agents, _All)]
    world: AnyWorld | None = None
    groups: Groups = field(default_factory=dict)
    links: LinksText = Links()  # noqa: RUF009 - frozen
    faults: tuple[FaultEntry, ...] = ()
    overload: bool = False

    def in_run(self, entry: FaultEntry) -> bool:
        """Whether a fault starts before the end of the run."""
        return entry.start_ns < self.duration


@cache
def json_schema() -> dict[str, Any]:
    """JSON Schema of a scenario file, for editors; `name` is not required, as it defaults to the name of the file."""
    schema = TypeAdapter(typed(Scenario)).json_schema()
    required = [name for name in schema["required"] if name != "name"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "required": required}


def resolved_yaml(scenario: Scenario) -> str:
    """The scenario as YAML with all overrides and defaults, without faults that start after the end of the run.

    Reading it gives an equal scenario.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.default_flow_style = False
    yaml.allow_unicode = True
    yaml.width = 110
    text = io.StringIO()
    yaml.dump(settings(replace(scenario, faults=tuple(filter(scenario.in_run, scenario.faults)))), text)
    return text.getvalue()
