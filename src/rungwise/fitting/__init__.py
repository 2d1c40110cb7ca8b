"""Parameters of scenes from measured motions, and which rung explains these. Worlds are known by contract."""
