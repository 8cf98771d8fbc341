"""The agent that estimates the altitude from what nodes with sensors tell."""
