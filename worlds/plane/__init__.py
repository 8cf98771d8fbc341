"""A rigid body with distance sensors over a plane, `kind: plane`: the world of the flying array, Kriegleder 2012."""
