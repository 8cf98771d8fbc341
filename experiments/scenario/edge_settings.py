"""Settings of links from attributes of edges, in a file or in a graph of a user's own code."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
from pydantic import ValidationError

from ...errors import BadInput
from ...names import did_you_mean
from ...topologies import link_attributes, natural_key, ordered
from ...transport.faults import LinkName
from .explaining import explain
from .link_schema import LINK_FIELDS, LinkOverride, LinksText
from .presets import PRESET
from .settings_reading import validated
from .trace_files import anchor
from .yaml_document import describe, parse

_REMEDY = "remove it, or name it under the file's `attributes:` or `ignore:`"
_UNIT = "; in a file's settings, `attributes: {delay: latency ms}` gives plain numbers a unit"


def edge_settings(graph: nx.Graph, folder: Path) -> list[LinkOverride]:
    """The settings that a graph's edges give to links, as entries of `links: only:`; links that are alike in one.

    Text is read as in a scenario: `5 ms`, `{normal: {mean: 5 ms, sd: 1 ms}}`.

    Args:
        graph: a topology.
        folder: where the paths of traces start.
    Raises:
        BadInput: an attribute that is no setting, a value that is wrong, or edges that are joined and differ.
    """
    attributes = link_attributes(graph)
    _check_names(attributes)
    read: dict[str, dict[str, Any]] = {}
    alike: dict[str, tuple[dict[str, Any], list[LinkName]]] = {}
    for link in sorted(attributes, key=lambda link: [natural_key(end) for end in link]):
        settings: dict[str, Any] = {}
        for each in attributes[link]:
            key = repr(sorted(each.items()))
            if key not in read:
                read[key] = _read(link, {name: _plain(link, name, value) for name, value in each.items()}, folder)
            _join(link, settings, read[key])
        alike.setdefault(repr(sorted(settings.items())), (settings, []))[1].append(link)
    return [LinkOverride(_words(links), settings) for settings, links in alike.values()]


def _check_names(attributes: Mapping[LinkName, Sequence[Mapping[str, Any]]]) -> None:
    known = {*LINK_FIELDS, PRESET}
    unknown = {name: link for link, several in attributes.items() for each in several for name in each.keys() - known}
    if unknown:
        listed = sorted(unknown)
        name, link = listed[0], "-".join(ordered(*unknown[listed[0]]))
        more = f" (all such: {', '.join(listed)})" if len(listed) > 1 else ""
        hint = did_you_mean(name, known)
        raise BadInput(f"the edge {link} has the attribute {name!r}, no setting of links{hint}: {_REMEDY}{more}")


def _plain(link: LinkName, name: str, value: Any) -> Any:
    """An attribute as plain data; text is read as YAML."""
    place = f"the edge {'-'.join(link)}: {name}"
    if isinstance(value, str):
        return parse(value, place)
    plain = value.item() if isinstance(value, np.generic) else value
    try:
        json.dumps(plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{place}: {value!r} is no text, number, list or mapping") from error
    return plain


def _read(link: LinkName, values: dict[str, Any], folder: Path) -> dict[str, Any]:
    anchor(values, lambda _: folder)
    try:
        links = validated(LinksText, {"only": [{"where": ">".join(link), **values}]})
    except ValidationError as error:
        problems = [problem._replace(loc=problem.loc[2:]) for problem in explain(error)]
        text = "; ".join(describe(values, problem) for problem in problems)
        text += _UNIT if "has no unit" in text else ""
        raise BadInput(f"the edge {'-'.join(link)}: {text}") from error
    changes: dict[str, Any] = links.only[0].changes
    return changes


def _join(link: LinkName, settings: dict[str, Any], others: Mapping[str, Any]) -> None:
    """Add the settings of a parallel edge."""
    for name, value in others.items():
        if settings.setdefault(name, value) != value:
            raise BadInput(f"edges {'-'.join(link)} that are joined differ in {name}: {settings[name]} and {value}")


def _words(links: Sequence[LinkName]) -> tuple[str, ...]:
    """Links as words: `1-2` for both directions, `1>2` for one."""
    both = {link for link in links if link[::-1] in links}
    return tuple(
        "-".join(link) if link in both else ">".join(link)
        for link in links
        if link not in both or ordered(*link) == link
    )
