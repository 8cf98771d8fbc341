"""The formation of MAVs of Nägeli 2014: relative positions, who tracks whom, and the force that keeps the shape."""
