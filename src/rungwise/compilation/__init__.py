"""How kernels become machine code: all that knows numba; loaded when the first kernel is called."""
