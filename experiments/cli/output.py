"""Where the commands print: results to the standard output, errors to the standard error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable

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


def print_lines(lines: Iterable[str]) -> None:
    """Print many lines as they are; a reader that has enough, such as `head`, ends it quietly."""
    try:
        for line in lines:
            sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nor may the interpreter complain at its end


def print_note(message: str) -> None:
    """Say something about the output that is not part of it."""
    Console(stderr=True, highlight=False).print(message, markup=False, soft_wrap=True)
