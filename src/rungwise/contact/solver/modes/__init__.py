"""Contact modes of few bodies in the plane, one linear system each."""
