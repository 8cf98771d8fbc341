"""Where the commands print: results to the standard output, errors to the standard error."""

from __future__ import annotations

import os
import sys

from rich.console import Console

_WIDTH = 120
"""Columns where the output is no terminal, so that tables are the same in every file."""


def output() -> Console:
    """The standard output; text is printed as it is, without guessing at colours."""
    fits = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(highlight=False, width=None if fits else _WIDTH)


def print_plain(text: str) -> None:
    """Print lines as they are: no markup, no wrapping, so that paths can be copied and texts be piped."""
    output().print(text, markup=False, soft_wrap=True)


def print_error(message: str) -> None:
    """Print what went wrong; places such as file:line:column begin a line of their own."""
    start = "error:\n" if "\n" in message else "error: "
    Console(stderr=True, highlight=False).print(start + message, markup=False, soft_wrap=True, style="red")
