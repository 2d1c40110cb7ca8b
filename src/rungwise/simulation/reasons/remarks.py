"""Remarks on changes, omissions and oddities of a run, one line each, for `Run.notes`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache

from rungwise.kernel import RecordArray
from rungwise.models.ladder import LADDER, Rung
from rungwise.outcome import Outcome
from rungwise.scene import Scene
from rungwise.simulation.inputs import Segment
from rungwise.wording import listed

SHORTENED = 2.0
"""Number of steps over the number asked for from which on a remark is made."""
FINE, COARSE = 1e-9, 1e-2
"""The goal's tolerance in reaches of the smallest shape: gaps below the first count as rounding where bodies
touch at the start (`loop.CLOSED`, `tolerances.EXACT`), so that no gap is known so well; above the second,
bodies would count as touching that are apart to the eye."""
ROUGH = 2e-3
"""Error allowed in a step, in reaches of the smallest body that forces move, from which on the course after
impacts is not sure. Chosen by trial."""


def remarks(
    rung: Rung, theta: float, control: RecordArray, clock: RecordArray, size: Callable[[], float],
    short: Callable[[], str],
) -> tuple[str, ...]:  # fmt: skip
    """All remarks on a run so far, beside its verdict; add a line here for a new kind.

    `control` (1,) holds the options as the run took them, `clock` (1,) how far it has come; `size` tells the
    reach of the smallest body that forces move, `short` a clause on what kept steps short.
    """
    found = (
        _theta(rung, theta),
        _step(control, clock, short),
        _tolerance(control, clock),
        _error(rung, control, size),
        _jumps(clock),
        _strays(clock),
    )
    return tuple(remark for remark in found if remark)


def advice(outcome: Outcome, rung: Rung, has_goal: bool, still: str = "") -> str:
    """The advice of an outcome, as it fits the rung and the scene; `still`: why more time alone would not
    help (see `stillness`)."""
    if outcome is Outcome.GOAL:
        richer = LADDER[[known.name for known in LADDER].index(rung.name) + 1 :]
        return f"The next rung is {richer[0].name}." if richer else "This is the richest rung."
    if outcome is Outcome.TIMEOUT and has_goal:
        return still or "Give more time (--time)."
    return outcome.advice


def stillness(bodies: Mapping[str, tuple[float, bool]], time: float, tolerance: float) -> str:
    """A sentence where nothing moves at the end of a run, or nothing but what drives lead; empty elsewhere.
    `bodies` gives the speed of each body, and whether drives lead it; what would go no farther than the
    tolerance in as much time again does not move."""
    moving = {name: led for name, (speed, led) in bodies.items() if not speed * time <= tolerance}
    if not moving:
        return "Nothing moves any more: more time changes nothing. Change inputs, drives or the start."
    if all(moving.values()):
        verb, they = ("moves", "it touches") if len(moving) == 1 else ("move", "they touch")
        return (
            f"Only {listed(moving)}, led by drives, still {verb}: more time (--time) helps only if {they}"
            " something."
        )
    return ""


@lru_cache(maxsize=64)
def unmet(number: int, segment: Segment, since: float) -> str:
    """That the condition of a segment, which began then, did not hold in its time."""
    return (
        f"inputs.{number}.until: {segment.until} did not hold within {segment.duration:g}"
        f" (from t = {since:.6g} on)"
    )


def untouchable(scene: Scene) -> tuple[str, ...]:
    """A line for bodies that move, that no joint holds, and that nothing can touch."""
    met = {name for pair in scene.template.contacts for name in pair}
    met |= {name for joint in scene.file.joints.values() for name in joint.between}
    alone = [name for name, body in scene.file.bodies.items() if body.coordinate_names and name not in met]
    if not alone:
        return ()
    verb, them = ("moves", "it") if len(alone) == 1 else ("move", "them")
    return (f"contacts: {listed(alone)} {verb}, and no entry lets anything touch {them}",)


def _theta(rung: Rung, theta: float) -> str:
    if theta == 1.0 or rung.record(theta)["theta"][0] == theta:
        return ""
    return f"theta: {theta:g} has no effect on the {rung.name} rung: its steps are fully implicit"


def _step(control: RecordArray, clock: RecordArray, short: Callable[[], str]) -> str:
    """A step of fixed length that was far too long for the scene."""
    step, duration, steps, time = (
        float(control[0]["step"]),
        float(control[0]["duration"]),
        int(clock[0]["steps"]),
        float(clock[0]["time"]),
    )
    if control[0]["error"] > 0.0 or steps == 0:
        return ""
    lines = []
    if step > duration:
        lines.append(f"{step:g} is longer than the whole run ({duration:g})")
    if steps > SHORTENED * max(1.0, time / min(step, duration)):
        lines.append(
            f"{steps} steps were taken, {time / steps:.3g} long on average: {short() or 'longer ones failed'}"
        )
    return "step: " + "; ".join(lines) if lines else ""


def _tolerance(control: RecordArray, clock: RecordArray) -> str:
    """A tolerance that is out of proportion to the shapes: most often it was left at its default."""
    tolerance, smallest = float(control[0]["tolerance"]), float(clock[0]["smallest"])
    if not math.isfinite(smallest) or FINE * smallest <= tolerance <= COARSE * smallest:
        return ""
    fine = tolerance < FINE * smallest
    why = "gaps are not computed so accurately" if fine else "what is apart would count as touching"
    return (
        f"tolerance: {tolerance:.3g} is out of proportion to the smallest shape, whose reach is"
        f" {smallest:.3g}: {why}; {1e-6 * smallest:.1g} would fit"
    )


def _error(rung: Rung, control: RecordArray, reach: Callable[[], float]) -> str:
    """An allowed error that is not small beside the bodies, where they have momentum: impacts turn small
    errors into other courses."""
    error = float(control[0]["error"])
    if rung.inertia == 0.0 or error == 0.0:
        return ""
    size = reach()
    if not math.isfinite(size) or error <= ROUGH * size:
        return ""
    return (
        f"tol: {error:.3g} is not small beside the smallest body that moves, whose reach is {size:.3g}: after"
        f" impacts the motion and the outcome may be wrong; {ROUGH * size:.1g} or less would fit"
    )


def _jumps(clock: RecordArray) -> str:
    """Velocities that jumped though nothing collided."""
    count, time = int(clock[0]["jumps"]), float(clock[0]["jump_time"])
    if count == 0:
        return ""
    more = f", and {count - 1} times after that" if count > 1 else ""
    return (
        f"at t = {time:.6g}{more} velocities jumped without a collision: no acceleration satisfies rigid"
        " contact with so much friction (Painlevé); a compliant rung shows what happens there"
    )


def _strays(clock: RecordArray) -> str:
    """Contacts that a long step left wide open."""
    gap, time, step = (float(clock[0][name]) for name in ("stray", "stray_time", "stray_step"))
    if gap == 0.0:
        return ""
    return (
        f"step: from t = {time:.6g} a step of {step:.3g} pressed bodies together and left them {gap:.3g}"
        " apart: shorter steps, or --tol, follow the motion in between, if anything damps it"
    )
