"""Figures, diagrams and films of a run."""
