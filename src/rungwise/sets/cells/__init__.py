"""Trees of cells with labels, and boundaries between labels."""
