"""Measurement units that agree on the attitude of their body."""
