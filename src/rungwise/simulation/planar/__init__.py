"""The compiled loop of planar scenes: one kernel from the start of a run to its outcome."""
