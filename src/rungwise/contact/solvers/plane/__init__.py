"""The chain that a step of many bodies in the plane runs: compressed rows, islands, sparse factors."""
