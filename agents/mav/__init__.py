"""Micro aerial vehicles in a formation."""
