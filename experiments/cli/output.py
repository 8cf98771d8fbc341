"""Output of the commands: results to standard output, errors to standard error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable

from rich.console import Console

_WIDTH = 120
"""Width of tables if the output is not a terminal, so that files are the same everywhere."""


def output() -> Console:
    """The standard output, without automatic highlighting."""
    fits = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(highlight=False, width=None if fits else _WIDTH)


def print_plain(text: str) -> None:
    """Print text without markup and wrapping, so that paths can be copied and text piped."""
    output().print(text, markup=False, soft_wrap=True)


def print_error(message: str) -> None:
    """Print an error; each place such as file:line:column begins a line."""
    start = "error:\n" if "\n" in message else "error: "
    Console(stderr=True, highlight=False).print(start + message, markup=False, soft_wrap=True, style="red")


def print_lines(lines: Iterable[str]) -> None:
    """Print many lines; end quietly if the reader closes the pipe, such as `head`."""
    try:
        for line in lines:
            sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains at exit


def print_note(message: str) -> None:
    """Print a note about the output to standard error."""
    Console(stderr=True, highlight=False).print(message, markup=False, soft_wrap=True)
