"""Runs and scenes for other programs: trajectories of joints, and MJCF with keyframes."""
