"""Sets of states from which no input reaches the goal."""
