"""Searches for plans on one stage: trees, shooting, and plans laid out as one schedule."""
