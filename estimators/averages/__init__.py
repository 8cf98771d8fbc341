"""Laws of average consensus: agents exchange messages with their neighbours until all know the mean."""
