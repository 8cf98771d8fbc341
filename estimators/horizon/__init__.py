"""Moving horizon estimation, Bassolillo 2025: error-state models, and windows of measurements with bounds."""
