"""The chain that a step in space runs: islands, their rows, and solvers of one island."""
