"""The Distributed Flight Array of Kriegleder 2012: tilt and altitude by least squares and consensus."""
