"""Read values from plain data by annotated types: settings as frozen dataclasses, quantities in units, kinds by name.

What an annotation says (`Unit`, `Kinds`, `Bounds`, `OneOrMany`, `Reader`, `Check`) is turned into types of pydantic;
validation and JSON Schema come from the same types.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, cached_property, partial, reduce
from operator import or_
from types import GenericAlias, MappingProxyType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
    create_model,
)
from pydantic.errors import PydanticSchemaGenerationError
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from ...errors import BadInput
from ...kinds import Kinds
from ...names import did_you_mean
from ...units import Bounds, OneOrMany, Unit, within_bounds
from ...worlds.signals import Steps
from .annotations import is_union, mark, owned, written_name
from .dumping import dumped
from .field_docs import described, summary
from .number_types import quantity_type, within
from .strict_reading import STRICT, read_model, strictly
from .trace_files import STAND_INS

TAG = "kind"
_OWN_PATTERN = r"^[^:]+:[^:]+$"
_OWN = Annotated[str, Field(pattern=_OWN_PATTERN)]
"""Import strings of users' own kinds."""


@dataclass(frozen=True)
class Reader:
    """Marks a type with the function that reads it, and with pydantic's type of its source, for JSON Schema.

    dump: the value as plain data that reads back equal.
    """

    read: Callable[[Any], Any]
    source: Callable[[], Any]
    dump: Callable[[Any], Any] | None = None

    def __get_pydantic_core_schema__(self, _source: Any, _handler: GetCoreSchemaHandler) -> CoreSchema:
        """Read with the function alone."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, _schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """The schema of the source type, built on demand."""
        return handler(self._text)

    @cached_property
    def _text(self) -> CoreSchema:
        source = TypeAdapter(self.source()).core_schema
        return core_schema.no_info_before_validator_function(lambda value: value, source)


def alternatives(*hints: Any) -> Any:
    """The union of several annotated types, as pydantic takes it."""
    return any_of([typed(hint) for hint in hints])


def any_of(shapes: Sequence[Any]) -> Any:
    """The union of types of pydantic."""
    return reduce(or_, shapes)


@dataclass(frozen=True)
class Check:
    """Marks a type with a function that returns the value, or raises BadInput."""

    check: Callable[[Any], Any]


def validated(hint: Any, value: Any) -> Any:
    """The value of an annotated type, read strictly: no text for a number.

    Lists are read as tuples, mappings as settings.

    Raises:
        ValidationError: all errors, each with its place.
    """
    return strictly(_adapter(hint), value)


@cache
def _adapter(hint: Any, owner: Unit | None = None) -> TypeAdapter[Any]:
    return TypeAdapter(typed(hint, owner))


def _mapping(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BadInput(f"should be a mapping of fields, not {value!r}")
    return value


def typed(hint: Any, owner: Unit | None = None) -> Any:
    """Pydantic's type for an annotated type; `owner`: the unit of numbers that take that of the enclosing field."""
    hint = owned(hint, owner)
    base = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if (several := mark(hint, OneOrMany)) is not None:
        return Annotated[base, _one_or_many(base, several)]
    if (kinds := mark(hint, Kinds)) is not None:
        return Annotated[base, one_of(kinds, mark(hint, Unit))]
    if (reader := mark(hint, Reader)) is not None:
        return Annotated[base, reader]
    unit = mark(hint, Unit)
    bounds = mark(hint, Bounds) or Bounds()
    found = within(_structure(base, owner) if unit is None else quantity_type(base, unit, bounds), bounds)
    return found if (check := mark(hint, Check)) is None else Annotated[found, AfterValidator(check.check)]


def _structure(base: Any, owner: Unit | None) -> Any:
    """A type without marks of its own."""
    if isinstance(base, type) and (is_dataclass(base) or issubclass(base, BaseModel)):
        return Annotated[base, _settings(base, owner)]
    parts = get_args(base)
    if is_union(base):
        return _union([part for part in parts if part is not type(None)], type(None) in parts, owner)
    if get_origin(base) in (None, Literal) or not parts:
        return base
    whole = get_origin(base)[tuple(part if part is Ellipsis else typed(part, owner) for part in parts)]
    if issubclass(get_origin(base), Mapping) and mark(parts[0], Unit) is not None:
        return Annotated[base, _by_quantity(whole)]
    return whole


def _settings(cls: Any, owner: Unit | None) -> Reader:
    """The reader of a dataclass or a model."""
    if cls is Steps:
        return _steps(owner)
    if issubclass(cls, BaseModel):
        return Reader(partial(read_model, cls), lambda: cls)
    if inline_field(cls) is not None:
        return Reader(partial(_read_inline, cls), partial(_inline_text, cls))
    read_as: Any = STAND_INS.get(cls, cls)
    return Reader(partial(_read_settings, read_as, owner), partial(model_of, read_as, owner))


def _read_settings(cls: Any, owner: Unit | None, value: Any) -> Any:
    made = within_bounds(cls(**given(read_model(model_of(cls, owner), value))))
    return made.made() if cls in STAND_INS.values() else made


def _by_quantity(whole: Any) -> Reader:
    """A mapping with quantities as keys, of which none may occur twice, in two units."""
    adapter = TypeAdapter(whole)

    def read(value: Any) -> Any:
        found = strictly(adapter, value)
        if len(found) < len(value):
            raise BadInput(f"one of {', '.join(value)} occurs twice: keep one")
        return found

    return Reader(read, lambda: whole)


def _union(parts: list[Any], optional: bool, owner: Unit | None) -> Any:
    """The first alternative that reads the value; errors are those of the alternative that matches best."""
    shapes = tuple(typed(part, owner) for part in parts)
    whole = shapes[0]
    if len(shapes) > 1:
        whole = Annotated[Any, Reader(partial(_first, [TypeAdapter(each) for each in shapes]), partial(any_of, shapes))]
    return whole | None if optional else whole


def _first(adapters: list[TypeAdapter[Any]], value: Any) -> Any:
    text, errors = json.dumps(value), []
    for adapter in adapters:
        try:
            return adapter.validate_json(text, strict=True)
        except ValidationError as error:
            errors.append(error)
    raise max(errors, key=lambda error: max(_nearness(detail) for detail in error.errors(include_url=False)))


def _nearness(detail: Mapping[str, Any]) -> tuple[int, bool]:
    """How deep in the value an error is, and whether the value there is of the right type."""
    return len(detail["loc"]), not detail["type"].endswith("_type")


# -- settings -----------------------------------------------------------------------------------------------------


@cache
def model_of(
    cls: Any,
    owner: Unit | None = None,
    *,
    tag: str = "",
    beside: Any = None,
) -> type[BaseModel]:
    """The fields of a dataclass as a model; its `json_schema` says what JSON Schema is to demand of several fields.

    Args:
        cls: the dataclass.
        owner: the unit of numbers that take that of the enclosing field.
        tag: the value of a field `kind` in addition.
        beside: a dataclass with further fields of the same mapping.
    Raises:
        BadInput: a field of a type that no scenario can give, such as a generator.
    """
    shown: dict[str, Any] = {TAG: (Literal[tag], ...)} if tag else {}
    shown |= {} if beside is None else model_fields(beside)
    shown |= model_fields(cls, owner)
    name = f"{'' if beside is None else beside.__name__.strip('_')}{cls.__name__}"
    config = ConfigDict(**STRICT, json_schema_extra=getattr(cls, "json_schema", None))
    try:
        return create_model(name, __config__=config, __doc__=summary(cls), __module__=cls.__module__, **shown)
    except PydanticSchemaGenerationError as error:
        kind = next(iter(re.findall(r"<[^>]*>", str(error))), "unknown")
        text = f"{cls.__module__}:{cls.__qualname__} has a parameter of type {kind}"
        raise BadInput(f"{text}: a scenario gives numbers, text, lists, mappings and frozen dataclasses") from error


def model_fields(cls: Any, owner: Unit | None = None, *, optional: bool = False) -> dict[str, Any]:
    """The fields of a dataclass, as `pydantic.create_model` takes them; `optional`: none is required."""
    return {
        f"{field.name}_": (
            typed(hint, owner),
            _field(cls, field, name, hint, needed=_needed(field) and not optional, owner=owner),
        )
        for name, (hint, field) in read_fields(cls).items()
    }


def _needed(field: Any) -> bool:
    return field.default is field.default_factory is MISSING


def read_fields(cls: Any) -> dict[str, tuple[Any, Any]]:
    """Name in a scenario → annotated type and field, for all fields that a dataclass takes."""
    hints = get_type_hints(cls, include_extras=True)
    return {written_name(field): (hints[field.name], field) for field in fields(cls) if field.init}


def _field(cls: Any, field: Any, name: str, hint: Any, *, needed: bool, owner: Unit | None) -> Any:
    description = described(cls).get(field.name)
    if needed:
        return Field(alias=name, title=name, description=description)
    default = field.default if field.default_factory is MISSING else field.default_factory()
    extra = {} if default is MISSING or default is None else {"default": dumped(default, hint, owner)}
    return Field(default=None, alias=name, title=name, description=description, json_schema_extra=extra)


def given(model: BaseModel) -> dict[str, Any]:
    """Field → value, of the fields that were given."""
    return {name.removesuffix("_"): getattr(model, name) for name in model.model_fields_set if name.endswith("_")}


def inline_field(cls: Any) -> str | None:
    """The field whose own fields are in the same mapping as the others of the dataclass."""
    return next((field.name for field in fields(cls) if field.metadata.get("inline")), None)


def _read_inline(cls: Any, value: Any) -> Any:
    inline, hints = str(inline_field(cls)), read_fields(cls)
    own = {name: item for name, item in _mapping(value).items() if name in hints and name != inline}
    others = {name: item for name, item in value.items() if name not in own}
    beside = given(read_model(_outer_model(cls), own))
    return cls(**beside, **{inline: validated(hints[inline][0], others)})


@cache
def _outer_model(cls: Any) -> type[BaseModel]:
    return create_model(cls.__name__, __config__=STRICT, **_outer_fields(cls))


def _outer_fields(cls: Any) -> dict[str, Any]:
    return {name: field for name, field in model_fields(cls).items() if name != f"{inline_field(cls)}_"}


def _inline_text(cls: Any) -> Any:
    kinds = mark(read_fields(cls)[str(inline_field(cls))][0], Kinds)
    assert kinds is not None
    return _names_and_beside(kinds, None, _outer_fields(cls))


# -- several notations --------------------------------------------------------------------------------------------


def _one_or_many(base: Any, several: OneOrMany) -> Reader:
    (item, _) = get_args(base)

    def read(value: Any) -> Any:
        if several.none is not None and value in (None, several.none):
            return ()
        return validated(base, value if isinstance(value, list) else [value])

    def source() -> Any:
        listed = GenericAlias(list, (typed(item),))
        return any_of([typed(item), listed, *([Literal[several.none], None] if several.none is not None else [])])

    return Reader(read, source)


def _steps(owner: Unit | None) -> Reader:
    """Instant → level."""
    pairs = tuple[tuple[Annotated[int, Unit("ns")], Annotated[float, owner]], ...]

    def read(value: Any) -> Steps:
        if not isinstance(value, dict):
            raise BadInput(f"{value!r} must be a mapping of instants, as in {{0 s: …, 5 s: …}}")
        steps = sorted(validated(pairs, [list(pair) for pair in value.items()]))
        return Steps(tuple(time for time, _ in steps), tuple(level for _, level in steps))

    return Reader(read, lambda: typed(dict[str, Annotated[float, owner]]))


@cache
def one_of(kinds: Kinds, unit: Unit | None = None) -> Reader:
    """The reader of a value that is one of several kinds."""
    read, source = _NOTATIONS[kinds.tag]
    return Reader(partial(read, kinds, unit), partial(source, kinds, unit))


@cache
def _single(name: str, hint: Any, unit: Unit | None) -> TypeAdapter[Any]:
    """A mapping of one name to a value."""
    return TypeAdapter(create_model(name, __config__=STRICT, value=(typed(hint, unit), Field(alias=name))))


def _under(name: str, hint: Any, unit: Unit | None, value: Any) -> Any:
    """Read a value as the field `name`, so that errors have the name in their place."""
    return strictly(_single(name, hint, unit), {name: value}).value


def _by_key(kinds: Kinds, unit: Unit | None, value: Any) -> Any:
    body: Any = {}
    if isinstance(value, str) and (value[:1].isalpha() or value[:1] == "_"):
        name = value
    elif isinstance(value, str | int | float) and not isinstance(value, bool) and kinds.scalar:
        name, body = kinds.scalar, value
    elif isinstance(value, dict) and len(value) == 1:
        ((name, body),) = value.items()
    else:
        bare = "a value, or " if kinds.scalar else ""
        raise BadInput(f"write {bare}exactly one of {', '.join(kinds.names())}, not {value!r}")
    cls = kinds.find(name)
    if not isinstance(body, dict) and (taken := list(read_fields(STAND_INS.get(cls, cls)))) and cls is not Steps:
        body = {} if body is None else {taken[0]: body}
    return _under(name, cls, unit, body)


def _keys(kinds: Kinds, unit: Unit | None) -> Any:
    """Source of `key` kinds: a name, the value of the first field of `scalar`, or a mapping of one name."""
    given: dict[str, Any] = {}
    alone: list[str] = []
    shapes: list[Any] = []
    for number, name in enumerate(kinds.names()):
        cls = kinds.find(name)
        hints = read_fields(STAND_INS.get(cls, cls))
        needed = [hint for hint, field in hints.values() if _needed(field)]
        first = next(iter(hints.values()), (None, None))[0]
        shape = typed(cls, unit)
        if first is not None and len(needed) <= 1 and cls is not Steps:
            shape = shape | typed(first, unit)
        if not needed:
            alone.append(name)
        if name == kinds.scalar:
            shapes.append(typed(first, unit))
        given[f"kind{number}"] = (shape, Field(default=None, alias=name, title=name))
    one: dict[str, Any] = {"minProperties": 1, "maxProperties": 1}
    if kinds.entry_points:
        one["patternProperties"] = {_OWN_PATTERN: {}}
        shapes.append(_OWN)
    title = "".join(word.capitalize() for word in kinds.what.split())
    model = create_model(title, __config__=ConfigDict(**STRICT, json_schema_extra=one), **given)
    return any_of([model, *shapes, *([Literal[tuple(alone)]] if alone else [])])


def _by_kind(kinds: Kinds, unit: Unit | None, value: Any) -> Any:
    name, body = tagged(kinds, value)
    cls = kinds.settings(name)
    return kinds.made(name, within_bounds(cls(**given(read_model(model_of(cls, unit, tag=name), {TAG: name, **body})))))


def tagged(kinds: Kinds, value: Any) -> tuple[str, dict[str, Any]]:
    """The kind that a mapping names, and its other fields.

    Raises:
        BadInput: no mapping, no kind, or an unknown one.
    """
    mapping = _mapping({TAG: value} if isinstance(value, str) else value)
    if TAG not in mapping:
        raise BadInput(f"{TAG} is missing: one of {', '.join(kinds.names())}")
    name = str(mapping[TAG])
    try:
        kinds.find(name)
    except BadInput as error:
        raise BadInput(str(error), (TAG,)) from error
    return name, {key: item for key, item in mapping.items() if key != TAG}


def _tags(kinds: Kinds, unit: Unit | None) -> Any:
    """Source of `kind` kinds: a mapping with a field `kind`, or the name of a kind that needs no other field."""
    shapes: list[Any] = [model_of(kinds.settings(name), unit, tag=name) for name in kinds.names()]
    alone = [name for name, shape in zip(kinds.names(), shapes, strict=True) if len(shape.model_fields) == 1]
    return any_of([*shapes, *([Literal[tuple(alone)]] if alone else []), *([own_kind()] if kinds.entry_points else [])])


def _by_name_and_beside(kinds: Kinds, unit: Unit | None, value: Any) -> Any:
    known = kinds.names()
    if kinds.entry_points and (":" in value if isinstance(value, str) else TAG in _mapping(value)):
        if isinstance(value, dict) and (name := value[TAG]) in known:
            raise BadInput(f"kind is for code of your own: write {name} itself, as in {{{name}: …}}", (TAG,))
        return _by_kind(kinds, unit, value)
    found = [key for key in _mapping(value) if key in known]
    if not found:
        unknown = next(iter(value), None)
        hint = f"unknown kind {unknown!r}{did_you_mean(unknown, known)}" if unknown else "no kind"
        hint = f"write kind: {unknown}, and its parameters beside" if unknown and ":" in unknown else hint
        raise BadInput(hint if unknown else f"no kind: write one of {', '.join(known)}", (unknown,) if unknown else ())
    if len(found) > 1:
        raise BadInput(f"{' and '.join(found)} each name a kind: keep one")
    name, cls = found[0], kinds.find(found[0])
    body, beside = value[name], [key for key in value if key != name]
    if not isinstance(body, dict) or (name in read_fields(cls) and name not in body):
        return _of_flat(cls, read_model(flat_model(cls, name), value))
    if beside:
        text = f"{', '.join(beside)} beside {name}: move it into the mapping of {name}"
        raise BadInput(text, (beside[0],))
    return _under(name, cls, unit, body)


@cache
def flat_model(cls: Any, name: str) -> type[BaseModel]:
    """The fields of a kind, the first `plain` ones as the value of the field that has the kind's name."""
    hints = read_fields(cls)
    first = [hint for hint, _ in hints.values()][: cls.plain]
    value = typed(first[0]) if cls.plain == 1 else typed(tuple[tuple(first)])  # type: ignore[misc]
    given: dict[str, Any] = {"value": (value, Field(alias=name, title=name, description=summary(cls)))}
    for other, (hint, field) in list(hints.items())[cls.plain :]:
        given[f"{field.name}_"] = (typed(hint), _field(cls, field, other, hint, needed=_needed(field), owner=None))
    return create_model(cls.__name__, __config__=STRICT, __doc__=summary(cls), __module__=cls.__module__, **given)


def _of_flat(cls: Any, model: Any) -> Any:
    names = [field.name for _, field in read_fields(cls).values()][: cls.plain]
    values = (model.value,) if cls.plain == 1 else model.value
    return cls(**dict(zip(names, values, strict=True)), **given(model))


def _names_and_beside(kinds: Kinds, unit: Unit | None, others: Mapping[str, Any] = MappingProxyType({})) -> Any:
    """Source of `beside` kinds: the kind's name with the first fields as its value, or with all fields in a mapping."""
    shapes: list[Any] = []
    for name in kinds.names():
        cls = kinds.find(name)
        shapes.append(create_model(cls.__name__, __base__=flat_model(cls, name), **others))
        if list(read_fields(cls)) != [name]:
            below = (typed(cls, unit), Field(alias=name, title=name, description=summary(cls)))
            shapes.append(create_model(f"{cls.__name__}Below", __config__=STRICT, value=below, **others))
    return any_of([*shapes, *([own_kind(**others), *([] if others else [_OWN])] if kinds.entry_points else [])])


def own_kind(**others: Any) -> Any:
    """Source of a kind of a user's own: its import string, and any fields."""
    tag: Any = (_OWN, Field(alias=TAG, title=TAG, description="module:Name"))
    return create_model("OwnKind", __config__=ConfigDict(**{**STRICT, "extra": "allow"}), kind=tag, **others)


_NOTATIONS: Mapping[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "key": (_by_key, _keys),
    "kind": (_by_kind, _tags),
    "beside": (_by_name_and_beside, _names_and_beside),
}
