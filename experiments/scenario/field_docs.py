"""Descriptions of fields from the docstrings of dataclasses: lines such as `rate: samples per second`."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from functools import cache
from typing import Any

from .annotations import written_name

_LINE = re.compile(r"(\s*)(`?\w+`?(?:, `?\w+`?)*): (\S.*)")
_SENTENCE = re.compile(r"(?:^|(?<=[.;] ))((?:`\w+`(?:, | and )?)+): ([^;]*?)(?=\.(?: |$)|;|$)")


def summary(cls: Any) -> str | None:
    """The first paragraph of a docstring, on one line; None for the docstrings that dataclasses generate."""
    text = inspect.cleandoc(cls.__doc__ or "").partition("\n\n")[0]
    return None if text.startswith(f"{cls.__name__}(") else " ".join(text.split()) or None


@cache
def described(cls: Any) -> dict[str, str]:
    """Field → its description, inherited ones included."""
    names = {field.name: written_name(field) for field in fields(cls)}
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        for words, text in _entries(inspect.cleandoc(base.__doc__ or "")):
            found |= dict.fromkeys(words, text)
    return {name: found[word] for name, plain in names.items() for word in (name, plain) if word in found}


def _entries(doc: str) -> list[tuple[list[str], str]]:
    """Names and their text: from lines `name: text`, continued by indented lines, and from sentences "`name`: text"."""
    entries: list[tuple[list[str], list[str]]] = []
    indent, prose = -1, []
    for line in doc.splitlines():
        depth = len(line) - len(line.lstrip())
        if (match := _LINE.fullmatch(line)) and "`" not in match[2]:
            indent = depth
            entries.append((re.findall(r"\w+", match[2]), [match[3]]))
        elif indent >= 0 and line.strip() and depth > indent:
            entries[-1][1].append(line.strip())
        else:
            indent = -1
            prose.append(line.strip())
    sentences = _SENTENCE.finditer(" ".join(prose))
    return [
        *((words, " ".join(text)) for words, text in entries),
        *((re.findall(r"\w+", match[1].replace(" and ", " ")), match[2].strip()) for match in sentences),
    ]
