"""Models that are put together: parts in one world, and servos on joints."""
