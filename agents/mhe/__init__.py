"""The agent that estimates attitude and altitude by moving horizon."""
