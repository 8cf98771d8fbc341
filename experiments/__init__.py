"""Scenarios, runs and what is made of them: supervisor, record, verification, metrics, figures, command line."""
