"""Sweeps: a scenario over ranges of its fields, many times each, and what comes of it."""
