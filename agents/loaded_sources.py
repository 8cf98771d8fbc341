"""Which modules of a process are the user's own: neither the standard library's, nor installed, nor volery's."""

from __future__ import annotations

import sys
import sysconfig
from functools import cache
from pathlib import Path

MAIN = "__main__"
_OWN = __package__.partition(".")[0]
_INSTALLED = {"site-packages", "dist-packages"}


def loaded_sources() -> dict[str, str]:
    """Name → file of every module that is loaded from a file of the user's; the script that runs is `__main__`."""
    found = {}
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and name.partition(".")[0] != _OWN and _is_users(Path(file)):
            found[name] = str(Path(file).absolute())
    return found


def _is_users(path: Path) -> bool:
    absolute = path.absolute()
    if not _INSTALLED.isdisjoint(absolute.parts) or any(map(absolute.is_relative_to, _libraries())):
        return False
    return path.suffix != "" and path.is_file()


@cache
def _libraries() -> tuple[str, ...]:
    """Folders of the standard library, of installed commands, and of volery."""
    places = sysconfig.get_paths()
    return (places["stdlib"], places["platstdlib"], places["scripts"], str(Path(__file__).parents[1]))
