"""TDMA slots of radios: agents that can be received at one place take turns."""

from __future__ import annotations

from collections.abc import Mapping

import networkx as nx

from ...topologies import node_colouring
from ...transport.faults import LinkName
from ...transport.links import LinkSettings
from ...transport.media_settings import on_air


def radio_slots(links: Mapping[LinkName, LinkSettings]) -> dict[str, tuple[int, int]]:
    """Agent → (its slot, number of slots), for agents with a radio: a distance-2 colouring of the graph of radio links.

    Neighbours of one agent have different slots, so that no two frames overlap at a receiver or a sender.
    """
    radios = nx.Graph(link for link, settings in links.items() if on_air(settings.medium))
    if not radios:
        return {}
    colours = node_colouring(radios)
    count = 1 + max(colours.values())
    return {agent: (colour, count) for agent, colour in colours.items()}
