"""The agent that estimates the altitude from the measurements of sensor nodes."""
