"""Estimators and consensus laws: pure functions and small state machines over numpy.

`averages` holds the laws of average consensus, `distributed` the distributed Kalman filters. Then one folder per paper:
`flying_array` (Kriegleder 2012), `formation` and `frames` (Nägeli 2014), `attitude` (Betanzos 2024), `altitude`
(Bavle 2017), `horizon` (Bassolillo 2025). All share `information` pairs, `error_measures` and `checks` of arrays.
"""
