"""Attitude in a network of measurement units, Betanzos 2024: attitude from directions, and consensus on quaternions."""
