"""Answers made exact, and freed of what is undetermined."""
