"""Moving horizon estimation, Bassolillo 2025: models with an error state, and windows of them with bounds."""
