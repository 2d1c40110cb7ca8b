"""The six contact models as data, and the one assembly of their equation."""
