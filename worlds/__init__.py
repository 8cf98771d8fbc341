"""Worlds: the truth that agents estimate, and the sensors that look at it, as pure functions of seed and time.

One folder per kind, each with its settings: `plane`, `moving`, `altitude`, `quadrotor`, `rigid_body`, `formation`,
`target`. `world_kinds` finds a kind by name; `signals` and `random_walks` are shared.
"""
