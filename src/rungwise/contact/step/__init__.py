"""The problem of one compiled step, and the chain that solves it in the plane."""
