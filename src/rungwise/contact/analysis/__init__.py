"""What solutions tell: all solutions of a problem, closure, sensitivities."""
