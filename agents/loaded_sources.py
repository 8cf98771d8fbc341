"""Which modules of a process are the user's own: neither the standard library's, nor installed, nor volery's."""

from __future__ import annotations

import linecache
import sys
from inspect import isclass, isfunction
from pathlib import Path

from ..user_code import is_users

MAIN = "__main__"
_NOT_USERS = {__package__.partition(".")[0], "__mp_main__"}
"""Volery, and what multiprocessing calls `__main__` too."""


def loaded_sources() -> dict[str, str]:
    """Name → file of every module that is loaded from a file of the user's; the script that runs is `__main__`."""
    found = {}
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if not file or name.partition(".")[0] in _NOT_USERS:
            continue
        if is_users(file) and Path(file).suffix and Path(file).is_file():
            found[name] = str(Path(file).absolute())
    return found


def cells_text() -> str:
    """Text of the cells of a notebook in which functions and classes of `__main__` are defined; empty in a script."""
    main = sys.modules[MAIN]
    if Path(getattr(main, "__file__", "")).is_file():
        return ""
    own = [value for value in list(vars(main).values()) if getattr(value, "__module__", None) == MAIN]
    methods = [method for value in own if isclass(value) for method in vars(value).values()]
    names = dict.fromkeys(each.__code__.co_filename for each in (*own, *methods) if isfunction(each))
    cells = [name for name in names if not Path(name).is_file()]
    return "\n".join(filter(None, ("".join(linecache.getlines(cell)) for cell in cells)))
