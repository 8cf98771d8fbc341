"""Scenarios, runs and what is made of them: the supervisor, the record, verification, metrics, figures, command line."""
