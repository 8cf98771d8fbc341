"""Frames on which vehicles agree, Nägeli 2014: attitude from inertial measurements, and consensus on SO(3)."""
