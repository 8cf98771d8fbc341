"""The supervisor of a swarm of processes, and the line to it while it runs."""
