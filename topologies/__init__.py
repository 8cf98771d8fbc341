"""Communication graphs and consensus weights.

A topology is a networkx graph of named agents, validated once and listed in natural order: generators, arrays of
flying-array modules, files and the proximity graph of moving agents. Their settings in a scenario are in
`graph_settings`. Time-varying graphs, in `over_time`, consist of the union of all edges and the time spans in which
each edge is present. Other modules compute consensus weights, spectra and distances, and a colouring for slot plans.
"""

from .arrays import MODULE_SPACING, four_module_array, hexagonal, random_hexagonal, sixteen_module_array
from .colouring import node_colouring
from .fastest_mixing import fastest_mixing
from .files import read
from .formations import Formation
from .graph_settings import GraphSettings
from .graphs import Position, agents, edges, from_edges, neighbours, ordered, positions, validate
from .naming import check_name, natural_key
from .own_graphs import link_attributes, topology_of
from .presence import Edge, Span, TimedGraph, disconnected, mean_connectivity, mean_laplacian
from .random_graphs import erdos_renyi, geometric, proximity, small_world
from .regular import complete, grid, line, ring, star
from .spectra import (
    algebraic_connectivity,
    ball,
    contraction,
    diameter,
    laplacian,
    laplacian_spectrum,
    rounds_to,
)
from .weights import Weights, constant_edge, maximum_degree, metropolis, metropolis_weight, weight_matrix

__all__ = [
    "MODULE_SPACING",
    "Edge",
    "Formation",
    "GraphSettings",
    "Position",
    "Span",
    "TimedGraph",
    "Weights",
    "agents",
    "algebraic_connectivity",
    "ball",
    "check_name",
    "complete",
    "constant_edge",
    "contraction",
    "diameter",
    "disconnected",
    "edges",
    "erdos_renyi",
    "fastest_mixing",
    "four_module_array",
    "from_edges",
    "geometric",
    "grid",
    "hexagonal",
    "laplacian",
    "laplacian_spectrum",
    "line",
    "link_attributes",
    "maximum_degree",
    "mean_connectivity",
    "mean_laplacian",
    "metropolis",
    "metropolis_weight",
    "natural_key",
    "neighbours",
    "node_colouring",
    "ordered",
    "positions",
    "proximity",
    "random_hexagonal",
    "read",
    "ring",
    "rounds_to",
    "sixteen_module_array",
    "small_world",
    "star",
    "topology_of",
    "validate",
    "weight_matrix",
]
