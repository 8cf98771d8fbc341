"""Worlds: the truth that agents estimate, and the sensors that look at it, as pure functions of seed and time.

A folder a kind, whose `scenario` is what a scenario may write of it: `plane`, `moving`, `altitude`, `quadrotor`,
`rigid_body`, `formation`, `target`. `scenario` builds a world of any kind, and `signals` and `walks` are for all.
"""
