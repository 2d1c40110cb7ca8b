"""Kernels of contact modes: forces in friction cones, and motions that contacts allow."""
