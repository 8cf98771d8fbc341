"""A common inertial frame of all vehicles, Nägeli 2014: attitude from inertial measurements, and consensus on SO(3)."""
