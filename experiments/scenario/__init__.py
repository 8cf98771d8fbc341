"""Scenarios: from a YAML file, read and validated, to a plan."""
