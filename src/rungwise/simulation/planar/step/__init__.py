"""One step of a planar run: attempts, halves, motions chosen, and what forbids a step."""
