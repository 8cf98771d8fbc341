"""The `links` of a scenario: settings of all links, a preset, and overrides for some links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache, partial
from types import GenericAlias
from typing import Annotated, Any, get_type_hints

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model

from ...transport.links import Bucket, LinkSettings
from ...transport.media_settings import HalfDuplex
from .dumping import settings
from .fault_places import Words
from .field_docs import described, summary
from .presets import PRESET, PresetName, with_preset
from .settings_reading import Reader, any_of, given, model_fields, typed, validated
from .strict_reading import STRICT

_PRESET: Any = (PresetName, Field(default=None, alias=PRESET, title=PRESET, description="links of well-known hardware"))
LINK_FIELDS = tuple(field.name for field in fields(LinkSettings))


def _partial_model(cls: type[Any], json_schema: dict[str, Any] | None = None) -> type[BaseModel]:
    """The fields of a dataclass, none of them required; each is checked on its own.

    json_schema: what JSON Schema is to demand of several fields.
    """

    def alone(name: str, value: Any) -> Any:
        cls(**{name: value})
        return value

    shown: dict[str, Any] = {
        name: (Annotated[shape, AfterValidator(partial(alone, name.removesuffix("_")))], field)
        for name, (shape, field) in model_fields(cls, optional=True).items()
    }
    config = ConfigDict(**STRICT, json_schema_extra=json_schema)
    return create_model(cls.__name__, __config__=config, __doc__=summary(cls), __module__=cls.__module__, **shown)


_WHOLE = {"properties": {"medium": {"required": ["kind"]}, "bucket": {"required": ["rate", "burst"]}}}


@cache
def _changes_model() -> type[BaseModel]:
    return _partial_model(LinkSettings, {"if": {"not": {"required": [PRESET]}}, "then": _WHOLE})


def _read_changes(value: Any) -> dict[str, Any]:
    return given(validated(_changes_model(), value))


def dumped_changes(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes of a link's settings as plain data."""
    return {name: value for name, value in settings(LinkSettings(**changes)).items() if name in changes} | {
        name: None for name, value in changes.items() if value is None
    }


LinkChanges = Annotated[Mapping[str, Any], Reader(_read_changes, _changes_model, dumped_changes)]
"""Changes of a link's settings; absent fields keep their values."""


@dataclass(frozen=True)
class LinkOverride:
    """Changes for some links; `where` as in faults, later entries take precedence."""

    where: tuple[str, ...]
    changes: dict[str, Any]


@dataclass(frozen=True)
class Links:
    """The links of a scenario."""

    base: LinkSettings = LinkSettings()  # noqa: RUF009 - frozen
    only: tuple[LinkOverride, ...] = ()


@cache
def _only_model() -> type[BaseModel]:
    where = (typed(Words), Field(alias="where", title="where", description="links, as in faults"))
    return create_model("OtherLinks", __base__=_changes_model(), preset_=_PRESET, where_=where, **_parts())


@cache
def _links_model() -> type[BaseModel]:
    field: Any = Field(default=[], alias="only", title="only", description="changes for some links")
    only: Any = (GenericAlias(list, (typed(_only_model()),)), field)
    return create_model("Links", __base__=_changes_model(), preset_=_PRESET, only_=only, **_parts())


def _parts() -> dict[str, Any]:
    """Fields for a medium and a bucket that may be incomplete, for use with a preset."""
    hints = get_type_hints(LinkSettings, include_extras=True)
    found: dict[str, Any] = {}
    for name, cls in (("medium", HalfDuplex), ("bucket", Bucket)):
        reader = Reader(partial(validated, hints[name]), partial(_or_part, hints[name], cls))
        shown = Field(default=None, alias=name, title=name, description=described(LinkSettings)[name])
        found[f"{name}_"] = (Annotated[Any, reader], shown)
    return found


def _or_part(hint: Any, cls: type[Any]) -> Any:
    return any_of([typed(hint), _partial_model(cls)])


def _read_links(value: Any) -> Links:
    filled = with_preset(value)
    if isinstance(filled, dict) and isinstance(filled.get("only"), list):
        filled = {**filled, "only": [with_preset(entry) for entry in filled["only"]]}
    base = given(validated(_links_model(), filled))
    only = tuple(LinkOverride(entry.pop("where"), entry) for entry in map(given, base.pop("only", ())))
    for settings_given in (base, *(entry.changes for entry in only)):
        settings_given.pop(PRESET, None)
    return Links(LinkSettings(**base), only)


def _dumped_links(links: Links) -> dict[str, Any]:
    only = [{"where": list(each.where), **dumped_changes(each.changes)} for each in links.only]
    return {**settings(links.base), "only": only}


LinksText = Annotated[Links, Reader(_read_links, _links_model, _dumped_links)]
"""The scenario's `links:`, settings of all links and, under `only`, changes for some."""
