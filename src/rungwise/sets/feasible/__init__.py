"""Sets of parameters by the outcome of the scene."""
