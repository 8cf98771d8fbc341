"""Links of well-known hardware: `links: {preset: irda-115k, …}`, each number with its source.

A preset has the fields that a scenario might have under `links:` itself, in a file of its name. The numbers are typical
of a class of hardware, not measured; what no standard or data sheet says keeps its default.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from ...errors import BadInput
from ...names import did_you_mean
from .settings_reading import Reader
from .yaml_document import parse

PRESET = "preset"
_FOLDER = Path(__file__).parents[2] / "scenarios" / "presets"
_MERGED = ("medium", "queue", "bucket")
"""Fields of which a scenario may change a part."""


@dataclass(frozen=True)
class Preset:
    """A preset.

    links: settings as under `links:` of a scenario.
    sources: field → source of its number.
    about: the hardware.
    missing: what the preset leaves out.
    """

    links: Mapping[str, Any]
    sources: Mapping[str, str]
    about: str
    missing: str


@cache
def presets() -> Mapping[str, Preset]:
    """All presets by name."""
    files = sorted(_FOLDER.glob("*.yaml"))
    return {path.stem: Preset(**parse(path.read_text(encoding="utf-8"), path.name)) for path in files}


def _known(name: Any) -> str:
    if name not in presets():
        raise BadInput(f"there is no preset {name!r}{did_you_mean(str(name), presets())}")
    return str(name)


PresetName = Annotated[str, Reader(_known, lambda: Literal[tuple(presets())])]


def with_preset(links: Any) -> Any:
    """A scenario's `links:` with the fields of its preset filled in, where it has none of its own.

    A medium, a queue and a bucket are merged field by field. An unknown preset is left for the validator.
    """
    preset = presets().get(links[PRESET]) if isinstance(links, dict) and PRESET in links else None
    if preset is None:
        return links
    filled = {**preset.links, **links}
    for name in _MERGED:
        own, given = preset.links.get(name), links.get(name)
        if (
            isinstance(own, Mapping)
            and isinstance(given, dict)
            and given.get("kind", own.get("kind")) == own.get("kind")
        ):
            filled[name] = {**own, **given}
    return filled
