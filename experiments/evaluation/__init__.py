"""What a run is judged by: the truth, the central estimate, errors, findings and views of each kind of agents."""
