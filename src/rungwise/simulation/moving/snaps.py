"""Balance that ends at once, in words."""

from __future__ import annotations

from rungwise.simulation.core.stepper import Stepper


def snaps(stepper: Stepper, name: str, at: str) -> str:
    """Which body left its balance, when and how far; `at`: what touched it, in words."""
    return (
        f"at t = {stepper.time:.6g} {name} snaps out of its balance{at}: after {stepper.leapt:.3g} in one"
        " step it moves on however short the next is, and momentum, which this rung leaves out, decides"
        " where it rests. Use a dynamic rung, or damp the motion."
    )
