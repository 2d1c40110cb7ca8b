"""What conditions and schedules read, and what they decide: the same for runs of all systems."""
