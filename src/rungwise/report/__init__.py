"""Text and data reports for people."""
