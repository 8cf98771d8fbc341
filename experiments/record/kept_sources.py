"""The user's sources that a run was made with, in its folder: what a replay runs, whatever has become of the originals.

sources/ has each module under its name, as it would be found on a path, and the data files that the scenario names in
data/, under their whole paths; sources.json has for each the SHA-256 of its bytes and where it came from.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from hashlib import sha256
from pathlib import Path

from ...agents.loaded_sources import MAIN, cells_text
from ..whole_files import write_whole
from .run_files import MANIFEST_FILE, SOURCES_FOLDER

_DATA = "data"
_CELLS = "cells of a notebook"


def keep_sources(folder: Path, sources: Mapping[str, str], data: Iterable[Path] = ()) -> None:
    """Copy modules, name → file, and data files into a run's folder; what is gone from the disk is left out.

    Where the program that runs is a notebook, its cells are kept as __main__.py, for people.
    """
    kept = {_place(name, Path(file)): Path(file) for name, file in sorted(sources.items())}
    kept |= {f"{_DATA}{path.resolve()}": path for path in data}
    contents = {
        place: (content, str(original.absolute()))
        for place, original in kept.items()
        if (content := _content(original)) is not None
    }
    if cells := cells_text():
        contents[f"{MAIN}.py"] = cells.encode(), _CELLS
    manifest = {}
    for place, (content, original) in contents.items():
        target = folder / SOURCES_FOLDER / place
        target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, content)
        manifest[place] = {"sha256": _hash(content), "from": original}
    write_whole(folder / MANIFEST_FILE, json.dumps(manifest, indent=1))


def changed_sources(folder: Path) -> Iterator[str]:
    """Sentences about kept sources that were changed since, in the folder or where they came from."""
    try:
        manifest = json.loads((folder / MANIFEST_FILE).read_text("utf-8"))
    except FileNotFoundError:
        yield f"the run has kept no sources: {folder / MANIFEST_FILE} is missing"
        return
    for place, entry in manifest.items():
        kept, original = folder / SOURCES_FOLDER / place, Path(entry["from"])
        if not kept.is_file() or _hash(kept.read_bytes()) != entry["sha256"]:
            yield f"{kept} is not what the run kept"
        elif original.is_file() and _hash(original.read_bytes()) != entry["sha256"]:
            yield f"{original} has changed since the run, which kept it as it was"


def _place(name: str, file: Path) -> str:
    """Where a module is kept: a.b as a/b.py, a package as a/b/__init__.py."""
    below = name.replace(".", "/")
    return f"{below}/{file.name}" if file.stem == "__init__" else below + "".join(file.suffixes)


def _content(file: Path) -> bytes | None:
    try:
        return file.read_bytes()
    except OSError:
        return None


def _hash(content: bytes) -> str:
    return sha256(content).hexdigest()
