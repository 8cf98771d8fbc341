"""Beacons: how many frames they have received."""

from __future__ import annotations

from .evaluation import Component, Evaluation, Quantity


class BeaconEvaluation(Evaluation):
    """A number of frames."""

    quantities = (Quantity("received", (Component("received", "frames"),)),)
