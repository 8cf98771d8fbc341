"""Graphs and weights."""

from .naming import check_name, natural_key

__all__ = ["check_name", "natural_key"]
