"""The model of a scenario file: what may be written, and what it becomes."""

from __future__ import annotations

import io
import re
from functools import cache, partial
from typing import Annotated, Any, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PydanticUserError,
    TypeAdapter,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)
from ruamel.yaml import YAML

from ...agents import registry
from ...agents.plan import MILLISECOND_NS
from ...errors import BadInput
from ...units import Nanoseconds, quantity
from .explaining import schema_fields
from .fault_places import read_groups, read_words
from .link_schema import STRICT, LinkFields, Links, LinksFields, Reader, read_links, validated
from .timeline import FaultEntry
from .writing import spelled
from .yaml_document import Loc

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_PARAMETERS = ("parameters", "parameters")
"""Where the validator sees, below `agents` and its `only`, what the file has beside the fields of every kind."""


def _known_kind(kind: str) -> str:
    registry.find(kind)
    return kind


def _open_schema(schema: dict[str, Any]) -> None:
    """In the file the parameters stand beside the kind."""
    del schema["properties"]["parameters"]
    schema["additionalProperties"] = True


@cache
def _parameters_adapter(kind: str) -> TypeAdapter[Any]:
    parameters: Any = registry.find(kind).Parameters
    return TypeAdapter(create_model("AgentParameters", __config__=STRICT, parameters=(parameters, ...)))


class AgentKind(BaseModel):
    """What runs in agents: `kind`, its `compute` time [ns], and the kind's own parameters."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, json_schema_extra=_open_schema)

    kind: Annotated[str, AfterValidator(_known_kind)]
    compute: Nanoseconds = Field(default=MILLISECOND_NS, json_schema_extra={"default": "1 ms"})
    parameters: Any = Field(default_factory=dict, validate_default=True)

    @classmethod
    def fields_of_every_kind(cls) -> set[str]:
        """What is no parameter of the kind."""
        return cls.model_fields.keys() - {"parameters"}

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, written: Any) -> Any:
        if not isinstance(written, dict):
            return written
        own = cls.fields_of_every_kind()
        parameters = {name: value for name, value in written.items() if name not in own}
        return {**{name: value for name, value in written.items() if name in own}, "parameters": parameters}

    @field_validator("compute")
    @classmethod
    def _not_negative(cls, compute_ns: int) -> int:
        if compute_ns < 0:
            raise BadInput(f"compute is {quantity(compute_ns, 'ns')}, it must be at least 0")
        return compute_ns

    @field_validator("parameters")
    @classmethod
    def _read_parameters(cls, written: Any, info: ValidationInfo) -> Any:
        if "kind" not in info.data:
            return written
        return validated(_parameters_adapter(info.data["kind"]), {"parameters": written}).parameters


class SomeAgents(AgentKind):
    """Another kind for some agents; `where` as in faults, later entries on top."""

    where: Annotated[tuple[str, ...], Reader(read_words, str | int | list[str | int])]


_SOME: TypeAdapter[tuple[SomeAgents, ...]] = TypeAdapter(tuple[SomeAgents, ...])


class Agents(AgentKind):
    """The kind of all agents and, under `only`, what others are."""

    only: Annotated[tuple[SomeAgents, ...], Reader(partial(validated, _SOME), list[SomeAgents])] = ()


def _name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise BadInput(f"{name!r} cannot name a run: use letters, digits, '_', '-' and '.', a letter or digit first")
    return name


def _lasting(duration_ns: int) -> int:
    if duration_ns <= 0:
        raise BadInput(f"duration is {quantity(duration_ns, 'ns')}, it must be above 0: write for example 10 s")
    return duration_ns


def _seed(seed: int) -> int:
    if seed < 0:
        raise BadInput(f"seed is {seed}, it must be at least 0")
    return seed


class Scenario(BaseModel):
    """A scenario, validated field by field; whether its parts fit together is for `compile_plan` to say.

    Times are in nanoseconds. `topology` and `world` stay as they are written.
    """

    model_config = STRICT

    name: Annotated[str, AfterValidator(_name)]
    paper: str = ""
    description: str = ""
    seed: Annotated[int, AfterValidator(_seed)] = 0
    duration: Annotated[Nanoseconds, AfterValidator(_lasting)]
    topology: dict[str, Any]
    agents: Agents
    world: dict[str, Any] | None = None
    groups: Annotated[dict[str, tuple[str, ...]], Reader(read_groups, dict[str, list[str | int]])] = {}
    links: Annotated[Links, Reader(read_links, LinksFields)] = Links()
    faults: tuple[FaultEntry, ...] = ()
    overload: bool = False

    def in_run(self, entry: FaultEntry) -> bool:
        """Whether a fault starts before the end of the run."""
        return entry.start_ns < self.duration


SCENARIO: TypeAdapter[Scenario] = TypeAdapter(Scenario)


@cache
def _schema() -> dict[str, Any]:
    return SCENARIO.json_schema()


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scenario file, for editors; `name` may be left out there, the file's own name stands for it."""
    schema = _schema()
    required = [name for name in schema["required"] if name != "name"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "required": required}


def known_fields(data: Any, loc: Loc) -> set[str]:
    """Names that may stand in the mapping at a place of a scenario's data."""
    of_some = loc[:2] == ("agents", "only")
    within = loc[3 if of_some else 1 :]
    if loc[:1] != ("agents",) or within[:2] != _PARAMETERS:
        return schema_fields(_schema(), loc)
    model, written = (SomeAgents, data["agents"]["only"][loc[2]]) if of_some else (Agents, data["agents"])
    try:
        schema = _parameters_adapter(written["kind"]).json_schema()
    except PydanticUserError:
        return set()
    return schema_fields(schema, within[1:]) | (model.fields_of_every_kind() if within == _PARAMETERS else set())


def to_mapping(scenario: Scenario) -> dict[str, Any]:
    """A scenario as plain data, all defaults written out, without faults that start after the end of the run."""
    agents, links = scenario.agents, scenario.links
    mapping: dict[str, Any] = {
        "name": scenario.name,
        "paper": scenario.paper,
        "description": scenario.description,
        "seed": scenario.seed,
        "duration": quantity(scenario.duration, "ns"),
        "topology": scenario.topology,
        "agents": {**_kind(agents), "only": [{"where": list(some.where), **_kind(some)} for some in agents.only]},
        "world": scenario.world,
        "groups": {name: list(members) for name, members in scenario.groups.items()},
        "links": spelled(links.base),
        "faults": [_entry(entry) for entry in scenario.faults if scenario.in_run(entry)],
        "overload": scenario.overload,
    }
    mapping["links"]["only"] = [
        {"where": list(override.where), **spelled(override.changes, LinkFields)} for override in links.only
    ]
    return mapping


def _kind(agents: AgentKind) -> dict[str, Any]:
    return {"kind": agents.kind, "compute": quantity(agents.compute, "ns"), **spelled(agents.parameters)}


def _entry(entry: FaultEntry) -> dict[str, Any]:
    written: dict[str, Any] = {}
    for name, hint in get_type_hints(FaultEntry, include_extras=True).items():
        value = getattr(entry, name)
        if name in FaultEntry.model_fields and value is not None:
            alias = FaultEntry.model_fields[name].alias or name
            written[alias] = spelled(value, LinkFields if name == "set_" else hint)
    if entry.partition is not None:
        written["partition"] = entry.partition.written()
    return written


def resolved_yaml(scenario: Scenario) -> str:
    """The scenario as YAML with overrides and defaults in it; read back it is equal."""
    yaml = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.default_flow_style = False
    yaml.allow_unicode = True
    yaml.width = 110
    text = io.StringIO()
    yaml.dump(to_mapping(scenario), text)
    return text.getvalue()
