"""Attitude in a network of measurement units, Betanzos 2024: directions from a body, and consensus on quaternions."""
