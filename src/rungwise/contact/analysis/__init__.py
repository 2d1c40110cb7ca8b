"""All solutions, closure, sensitivities."""
