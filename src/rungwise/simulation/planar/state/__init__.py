"""What a planar run carries from step to step, and what is read from it."""
