"""Compilation of kernels: all modules that know numba, loaded when the first kernel is called."""
