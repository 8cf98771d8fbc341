"""Modules of the Distributed Flight Array."""
