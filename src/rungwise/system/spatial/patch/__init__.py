"""Contacts of two convex geoms: their distance, its normal, and where their nearest features lie over each
other."""
