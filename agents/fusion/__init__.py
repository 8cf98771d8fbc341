"""Agents with a distributed filter."""
