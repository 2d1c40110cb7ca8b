"""Balance that ends at once, and steps that nothing solves, in words."""

from __future__ import annotations

from rungwise.simulation.core.last_resort import RAN_AWAY
from rungwise.simulation.reasons.hindered import LEADING_ON
from rungwise.simulation.stepping.stepper import Stepper


def snaps(stepper: Stepper, name: str, at: str) -> str:
    """Which body left its balance, when and how far; `at`: what touched it, in words."""
    return (
        f"at t = {stepper.time:.6g} {name} snaps out of its balance{at}: after {stepper.leapt:.3g} in one"
        " step it moves on however short the next is, and momentum, which this rung leaves out, decides"
        " where it rests. Use a dynamic rung, or damp the motion."
    )


def led_on(stepper: Stepper, at: str) -> str:
    """What a step lacks that has neither a solution nor a proof, and what may lead on; `at`: where."""
    if stepper.lack == RAN_AWAY:
        return f"{stepper.lack}. Use a smaller step, or tol."
    lines = [f"at t = {stepper.time:.6g}{at} {stepper.lack}. A smaller step, or tol, may help."]
    if stepper.rung.name in LEADING_ON:
        lines.append(
            "If that changes nothing, for example because bodies are wedged,"
            f" {LEADING_ON[stepper.rung.name]}."
        )
    return " ".join(lines)
