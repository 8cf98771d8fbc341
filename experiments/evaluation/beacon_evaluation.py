"""Beacons: how many frames they have received."""

from __future__ import annotations

from ...quantities import Component, Quantity
from .evaluation import Evaluation


class BeaconEvaluation(Evaluation):
    """A number of frames."""

    quantities = (Quantity("received", (Component("received", "frames"),)),)
