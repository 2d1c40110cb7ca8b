"""Systems: sources of inertia, loads, gaps and Jacobians at a state, for models to assemble."""
