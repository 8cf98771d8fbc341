"""Distributed Kalman filters: beliefs about a dynamic state, fused in rounds of messages."""
