"""A target that moves in the plane, `kind: target`."""
