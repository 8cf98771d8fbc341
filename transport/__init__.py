"""Links between agents: wire format, impairments, media, faults, promises, the twin's heap, and the Zenoh adapter."""
