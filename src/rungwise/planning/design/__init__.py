"""Parameters with which a scene succeeds best, and how far they may drift."""
