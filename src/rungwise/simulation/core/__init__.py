"""Taking steps of any system: from `Terms` alone to velocities, forces, deformations and verdicts."""
