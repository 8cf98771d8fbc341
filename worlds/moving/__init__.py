"""Agents that move, `kind: moving`."""
