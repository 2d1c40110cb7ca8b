"""The spatial system: bodies of a MuJoCo model. MuJoCo gives kinematics, inertia and the geometry of
contacts, never their forces."""
