"""The formation of MAVs of Nägeli 2014: relative positions, assignment of cameras, and formation control."""
