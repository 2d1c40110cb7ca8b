"""All solutions of a problem, closure, sensitivities."""
