"""Dimensions of what scenes say: of the places in which numbers stand, and of expressions."""
