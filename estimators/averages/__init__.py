"""Laws of average consensus: what agents tell their neighbours until all know the mean."""
