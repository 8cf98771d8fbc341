"""A rigid body that turns, and measurement units on it, `kind: rigid-body`, Betanzos 2024."""
