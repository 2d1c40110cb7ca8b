"""Running scenes: steps, the compiled loop, trajectories."""
