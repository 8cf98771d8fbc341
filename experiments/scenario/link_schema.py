"""How links are written in a scenario: media, rates, loss and latency models, with one key that chooses the model."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, partial
from typing import Annotated, Any, Literal, Required, TypeVar, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
)
from pydantic import create_model as create_pydantic_model
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema
from typing_extensions import TypedDict

from ...errors import BadInput
from ...names import did_you_mean
from ...transport.csma import Csma
from ...transport.latencies import LATENCIES, Latency, LatencyTrace
from ...transport.links import Bucket, LinkSettings, Queue
from ...transport.losses import LOSSES, Loss, LossTrace
from ...transport.media import Access, Aloha, FullDuplex, HalfDuplex, Medium, SlottedAloha, Tdma
from ...units import BitsPerSecond, Bytes, Nanoseconds
from .explaining import explain, schema_fields
from .fault_places import read_words
from .presets import PRESET, PresetName, with_preset
from .trace_files import read_trace
from .yaml_document import describe

STRICT = ConfigDict(extra="forbid", strict=True, frozen=True)
ACCESSES: dict[str, Any] = {"aloha": Aloha, "slotted-aloha": SlottedAloha, "tdma": Tdma, "csma": Csma}

T = TypeVar("T")


def validated(adapter: TypeAdapter[T], value: Any) -> T:
    """The value read strictly: lists may stand for tuples and mappings for dataclasses, but no text for a number."""
    return adapter.validate_json(json.dumps(value), strict=True)


@dataclass(frozen=True)
class Reader:
    """Marks a type with the function that reads it, and with the type of what is written, for JSON Schema."""

    read: Callable[[Any], Any]
    written: Any

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Read with the function alone."""
        return core_schema.no_info_plain_validator_function(
            self.read, json_schema_input_schema=handler.generate_schema(self.written)
        )


@dataclass(frozen=True)
class _OrFirstField:
    """Tells JSON Schema that the value of a model's first field stands for all of it."""

    model: Any

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """The model's schema, or that of its first field."""
        hints = get_type_hints(self.model, include_extras=True)
        return {"anyOf": [handler(schema), TypeAdapter(hints[fields(self.model)[0].name]).json_schema()]}


def _is_one_value(model: Any) -> bool:
    """Whether the first field is all that a model needs."""
    return is_dataclass(model) and [field.default is MISSING for field in fields(model)].count(True) == 1


class OneOf:
    """Reads models that are written as a name, as `{name: {fields}}`, or as `{name: value of the first field}`.

    A bare value stands for the model `of_scalar`, where there is one.
    """

    def __init__(self, title: str, models: Mapping[str, Any], of_scalar: str | None = None) -> None:
        self._models = models
        self._of_scalar = of_scalar
        written: dict[str, Any] = {
            name.replace("-", "_"): (
                Annotated[model, _OrFirstField(model)] if _is_one_value(model) else model,
                Field(default=None, alias=name),
            )
            for name, model in models.items()
        }
        self.written = create_pydantic_model(title, __config__=STRICT, **written)
        self._adapter: TypeAdapter[BaseModel] = TypeAdapter(self.written)

    def read(self, value: Any) -> Any:
        """The model.

        Raises:
            BadInput: not one known name.
            ValidationError: its fields are wrong; places start with the name.
        """
        name, body = self._name_and_body(value)
        if name not in self._models:
            raise BadInput(f"unknown name {name!r}{did_you_mean(name, self._models)}")
        model = self._models[name]
        if body is None:
            body = {}
        elif not isinstance(body, dict) and is_dataclass(model) and fields(model):
            body = {fields(model)[0].name: body}
        return getattr(validated(self._adapter, {name: body}), name.replace("-", "_"))

    def _name_and_body(self, value: Any) -> tuple[str, Any]:
        if isinstance(value, str) and value[:1].isalpha():
            return value, None
        if isinstance(value, str | int | float) and not isinstance(value, bool) and self._of_scalar:
            return self._of_scalar, value
        if not isinstance(value, dict) or len(value) != 1:
            raise BadInput(f"write exactly one of {', '.join(self._models)}, not {value!r}")
        return next(iter(value.items()))


class _HalfDuplexFields(TypedDict, total=False):
    __pydantic_config__ = STRICT  # type: ignore[misc]
    per: Literal["edge", "node"]
    access: Annotated[Access, Reader(OneOf("AccessModel", ACCESSES).read, str | dict[str, Any])]


_HALF_DUPLEX: TypeAdapter[Any] = TypeAdapter(_HalfDuplexFields)
MEDIA: dict[str, Any] = {
    "full-duplex": FullDuplex,
    "half-duplex": Annotated[
        HalfDuplex, Reader(lambda value: HalfDuplex(**validated(_HALF_DUPLEX, value)), _HalfDuplexFields)
    ],
}
_MEDIUM = OneOf("MediumModel", MEDIA)


class _TraceFields(TypedDict, total=False):
    __pydantic_config__ = STRICT  # type: ignore[misc]
    file: str
    times: tuple[Nanoseconds, ...]
    repeat: Nanoseconds | None


class _LossTraceFields(_TraceFields, total=False):
    losses: tuple[float, ...]


class _LatencyTraceFields(_TraceFields, total=False):
    latencies: tuple[Nanoseconds, ...]


def _read_trace(model: Any, adapter: TypeAdapter[Any], column: str, value: Any) -> Any:
    """A trace from its file, or as the resolved scenario has it, with its numbers."""
    values = fields(model)[1].name
    given = validated(adapter, {"file": value} if isinstance(value, str) else value)
    numbers = {"times", values} & given.keys()
    if ("file" in given) == bool(numbers):
        raise BadInput(f"write a file, or times and {values}: one of the two, not {'both' if numbers else 'neither'}")
    if "file" in given:
        given["times"], given[values] = read_trace(given.pop("file"), column)
    if len(numbers) == 1:
        raise BadInput(f"times and {values} belong together")
    return model(**given)


def _trace(model: Any, written: Any, column: str) -> Any:
    return Annotated[model, Reader(partial(_read_trace, model, TypeAdapter(written), column), str | written)]


_LOSS = OneOf("LossModel", {**LOSSES, "trace": _trace(LossTrace, _LossTraceFields, "loss")}, of_scalar="bernoulli")
_LATENCY = OneOf(
    "LatencyModel",
    {**LATENCIES, "trace": _trace(LatencyTrace, _LatencyTraceFields, "latency")},
    of_scalar="constant",
)
_OneLoss = Annotated[Any, Reader(_LOSS.read, str | float | _LOSS.written)]
_LOSSES: TypeAdapter[tuple[Loss, ...]] = TypeAdapter(tuple[_OneLoss, ...])


class _MediumFields(_HalfDuplexFields, total=False):
    kind: Required[Literal["full-duplex", "half-duplex"]]


def _read_medium(value: Any) -> Any:
    if isinstance(value, dict):
        if "kind" not in value:
            raise BadInput(f"kind is missing: one of {', '.join(MEDIA)}")
        kind = str(value["kind"])
        return _MEDIUM.read({kind: {key: item for key, item in value.items() if key != "kind"}})
    return _MEDIUM.read(value)


def _read_losses(value: Any) -> tuple[Loss, ...]:
    if value is None or value == "none":
        return ()
    return validated(_LOSSES, value if isinstance(value, list) else [value])


Losses = Annotated[tuple[Loss, ...], Reader(_read_losses, str | float | _LOSS.written | list[_OneLoss] | None)]


def _bounded(name: str) -> AfterValidator:
    """Check a field as the link settings do, so that the error stands at the field."""

    def check(value: Any) -> Any:
        LinkSettings(**{name: value})
        return value

    return AfterValidator(check)


class LinkFields(TypedDict, total=False):
    """Settings of a link as they are written; those that are absent stay as they are."""

    __pydantic_config__ = STRICT  # type: ignore[misc]
    medium: Annotated[Medium, Reader(_read_medium, str | _MediumFields)]
    rate: Annotated[BitsPerSecond | None, _bounded("rate")]
    overhead: Annotated[Bytes, _bounded("overhead")]
    bits_per_byte: Annotated[int, _bounded("bits_per_byte")]
    mtu: Annotated[Bytes, _bounded("mtu")]
    queue: Queue
    bucket: Bucket | None
    loss: Losses
    corruption: Losses
    duplication: Annotated[float, _bounded("duplication")]
    latency: Annotated[Latency, Reader(_LATENCY.read, str | _LATENCY.written)]
    reordering: bool
    cut: bool
    hold: bool
    present: bool
    paired: Annotated[Nanoseconds | None, _bounded("paired")]


class _RandomFields(TypedDict):
    __pydantic_config__ = STRICT  # type: ignore[misc]
    random: float


Words = Annotated[tuple[str, ...], Reader(read_words, str | int | _RandomFields | list[str | int | _RandomFields])]


class _PresetFields(LinkFields, total=False):
    preset: PresetName


class _OnlyFields(_PresetFields, total=False):
    where: Required[Words]


class LinksFields(_PresetFields, total=False):
    """The scenario's `links:`, settings of all links and, under `only`, what differs on some."""

    only: list[_OnlyFields]


@dataclass(frozen=True)
class LinkOverride:
    """What differs on some links; `where` as in faults, later entries on top."""

    where: tuple[str, ...]
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class Links:
    """The links of a scenario."""

    base: LinkSettings = LinkSettings()  # noqa: RUF009 - frozen
    only: tuple[LinkOverride, ...] = ()


_LINKS: TypeAdapter[Any] = TypeAdapter(LinksFields)
_LINK_FIELDS: TypeAdapter[Any] = TypeAdapter(LinkFields)


def read_links(value: Any) -> Links:
    """The scenario's `links:` mapping."""
    written = with_preset(value)
    if isinstance(written, dict) and isinstance(written.get("only"), list):
        written = {**written, "only": [with_preset(entry) for entry in written["only"]]}
    given = validated(_LINKS, written)
    only = given.pop("only", ())
    for fields_given in (given, *only):
        fields_given.pop(PRESET, None)
    return Links(LinkSettings(**given), tuple(LinkOverride(entry.pop("where"), entry) for entry in only))


@cache
def _link_field_schema() -> dict[str, Any]:
    return _LINK_FIELDS.json_schema()


def link_changes(fields_written: Mapping[str, Any]) -> dict[str, Any]:
    """Field → new value of some link settings, from what is written, e.g. {"loss": 0.3, "latency": "2 ms"}.

    Raises:
        BadInput: nothing to change, an unknown field, or a value out of bounds.
    """
    if not fields_written:
        raise BadInput("nothing to set: write for example loss=0.3")
    try:
        changes: dict[str, Any] = validated(_LINK_FIELDS, dict(fields_written))
    except ValidationError as error:
        problems = explain(error, partial(schema_fields, _link_field_schema()))
        raise BadInput("; ".join(describe(fields_written, problem) for problem in problems)) from error
    return changes
