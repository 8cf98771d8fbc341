"""A quadrotor in controlled flight and its sensors, `kind: quadrotor`, Bassolillo 2025."""
