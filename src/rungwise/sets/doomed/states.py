"""States and inputs by name: the axes of a set of states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.scene import SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.language.expression import CONDITIONS
from rungwise.scene.language.lasting import FOR, names_in
from rungwise.sets.doomed.macro_steps import SPEED_OF, Stated
from rungwise.sets.store import SetError
from rungwise.simulation.threads import names_of
from rungwise.wording import choices


def state_name(side: Stated, name: str) -> str:
    """The full name of a coordinate or speed, from its full or short name. Raises SceneError or SetError."""
    inner = name[len(SPEED_OF) : -1] if name.startswith(SPEED_OF) and name.endswith(")") else name
    known = [each for each in side.known if each.startswith(SPEED_OF) == (inner != name)]
    full = [each[len(SPEED_OF) : -1] if inner != name else each for each in known]
    matches = [each for each in full if inner in (each, each.split(".")[1])]
    if len(matches) > 1:
        raise SetError(f"over: {inner[:60]!r} may be {' or '.join(matches)}; give the full name")
    if not matches:
        raise SceneError(
            f"state: unknown coordinate {str(name)[:60]!r}{choices(name, full)}, and speed() of them"
        )
    return known[full.index(matches[0])]


def check_states(side: Stated, scene: AnyScene, model: Rung, names: Sequence[str], most: int) -> None:
    """Raise SetError unless `names` are the scene's whole state, in space all of it that moves, and nothing
    else changes in time."""
    if model.compliant:
        raise SetError("model: compliant contacts have a state of their own; take a rigid rung")
    for field in CONDITIONS[:-1]:
        text = getattr(scene.file, field)
        if text is not None and FOR in names_in(text):
            raise SetError(f"{field}: for how long a condition has held is no state; ask without 'for'")
    if len(set(names)) < len(names):
        raise SetError("over: a state is given twice")
    needed, allowed = side.needed(model), side.allowed(model)
    missing, other = [n for n in needed if n not in names], [n for n in names if n not in allowed]
    if missing or other:
        what = f"lacks {', '.join(missing)}" if missing else f"{', '.join(other)} is prescribed, not a state"
        raise SetError(f"over: {what}; the state of {scene.name} on {model.name} is {', '.join(allowed)}")
    if not 1 <= len(names) <= most:
        raise SetError(f"over: 1 to {most} states, and {scene.name} has {len(names)}")
    if side.world.follows_time:
        raise SetError(f"scene: {scene.name} depends on the time t, which is no state")
    if scene.file.goal is None:
        raise SetError(f"scene: {scene.name} has no goal")


def columns_of(side: Stated, names: Sequence[str]) -> Ints:
    """Columns (d,) of states among all coordinates and then all speeds."""
    return np.array([side.known.index(name) for name in names], np.int64)


def box_of_states(
    side: Stated,
    values: Mapping[str, float],
    names: Sequence[str],
    box: Mapping[str, tuple[float, float]] | None,
) -> tuple[Reals, Reals]:
    """Intervals (d, 2) of states, as given or of their travel, and their travel (d, 2). Raises SetError."""
    given = {state_name(side, name): interval for name, interval in (box or {}).items()}
    limits = side.travel(values)
    intervals, travel = [], []
    for name in names:
        low, high = limits.get(name, (-math.inf, math.inf))
        first, last = (float(x) for x in given.get(name, (low, high)))
        if not (math.isfinite(first) and math.isfinite(last)):
            raise SetError(f"over: {name} needs an interval, {name}=LOW:HIGH")
        if not low <= first < last <= high:
            raise SetError(f"over: {name}={first:g}:{last:g} must be an interval within {low:g} to {high:g}")
        intervals.append((first, last))
        travel.append((low, high))
    return np.array(intervals), np.array(travel)


def input_box(scene: AnyScene, inputs: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Bounds of the inputs, checked. Raises SceneError or SetError."""
    result = {}
    for name in names_of(scene, tuple(inputs)):
        low, high = (float(x) for x in inputs[name])
        for value in (low, high):
            scene.parameters({name: value})
        if not low <= high:
            raise SetError(f"inputs: {name}={low:g}:{high:g} must be an interval")
        result[name] = (low, high)
    return result
