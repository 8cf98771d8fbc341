"""The Distributed Flight Array of Kriegleder 2012: the plane under rigid modules by least squares and consensus."""
