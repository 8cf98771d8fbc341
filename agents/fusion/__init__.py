"""Agents that fuse what they measure by a distributed filter."""
