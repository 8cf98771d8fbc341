"""A vehicle over the obstacles of a room, `kind: altitude`, Bavle 2017."""
