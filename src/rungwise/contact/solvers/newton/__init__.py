"""Newton's method on contact problems, and its linear systems."""
