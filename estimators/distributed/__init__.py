"""Distributed Kalman filters: beliefs about a state that moves, fused in rounds of messages."""
