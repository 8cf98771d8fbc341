"""Links of well-known hardware: `links: {preset: irda-115k, …}`, each number with its source.

A preset is what a scenario might have written under `links:` itself; each is a file of its name. The numbers are
typical ones of a class of hardware, not measurements; what no standard or data sheet says is left out, and so stays at
its default.
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
    """Settings of links as a scenario has them; field → where its number is from; what the preset does not have."""

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


def with_preset(written: Any) -> Any:
    """A scenario's `links:` with the preset that it names filled in; what is written beside it counts.

    Of a medium, a queue and a bucket single fields may be written. An unknown name is left for the validator.
    """
    preset = presets().get(written[PRESET]) if isinstance(written, dict) and PRESET in written else None
    if preset is None:
        return written
    filled = {**preset.links, **written}
    for name in _MERGED:
        own, given = preset.links.get(name), written.get(name)
        if (
            isinstance(own, Mapping)
            and isinstance(given, dict)
            and given.get("kind", own.get("kind")) == own.get("kind")
        ):
            filled[name] = {**own, **given}
    return filled
