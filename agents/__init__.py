"""What runs in a process: agents as state machines, the node that carries one, and the shell around it."""
