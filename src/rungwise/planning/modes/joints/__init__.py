"""Fingers that joints lead: chains of joints, and the joints with which one touches."""
