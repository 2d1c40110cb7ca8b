"""Taking steps, whatever the system: from `Terms` alone to velocities, forces, deformations and verdicts."""
