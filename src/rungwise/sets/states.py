"""States and inputs by name: the axes of a set of states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.scene import Scene, SceneError, load
from rungwise.scene import records as rec
from rungwise.sets.store import SetError
from rungwise.simulation.crew import names_of
from rungwise.wording import choices

SPEED_OF = "speed("


def state_name(scene: Scene, name: str) -> str:
    """The full name of a coordinate or speed, from its full or short name. Raises SceneError or SetError."""
    inner = name[len(SPEED_OF) : -1] if name.startswith(SPEED_OF) and name.endswith(")") else name
    matches = [full for full in scene.template.coordinates if inner in (full, full.split(".")[1])]
    if len(matches) > 1:
        raise SetError(f"over: {inner[:60]!r} may be {' or '.join(matches)}; give the full name")
    full = matches[0] if matches else inner
    named = full if inner == name else f"{SPEED_OF}{full})"
    _column(scene, named)
    return named


def _column(scene: Scene, name: str) -> int:
    """Index of a coordinate, or of its speed after all coordinates. Raises SceneError."""
    known = scene.template.coordinates
    inner = name[len(SPEED_OF) : -1] if name.startswith(SPEED_OF) and name.endswith(")") else name
    if inner not in known:
        raise SceneError(
            f"state: unknown coordinate {str(name)[:60]!r}{choices(name, known)}, and speed() of them"
        )
    return known.index(inner) + (len(known) if inner != name else 0)


def bodies_at(scene: Scene, columns: Ints, states: Reals) -> Reals:
    """Places, velocities and time 0 (m, 2 n + 1) at states (m, d) of these columns."""
    bodies = np.zeros((len(states), 2 * len(scene.template.coordinates) + 1))
    bodies[:, columns] = states
    return bodies


def check_states(scene: Scene, model: Rung, names: Sequence[str], most: int) -> None:
    """Raise SetError unless `names` are the scene's whole state, and nothing else changes in time."""
    if model.compliant:
        raise SetError("model: compliant contacts have a state of their own; take a rigid rung")
    if len(set(names)) < len(names):
        raise SetError("over: a state is given twice")
    needed = list(scene.template.coordinates)
    if model.inertia > 0.0:
        drives = records_of(scene).coordinates["drive"]
        needed += [
            f"{SPEED_OF}{name})" for name, drive in zip(needed, drives, strict=True) if drive != rec.SPEED
        ]
    missing, other = [n for n in needed if n not in names], [n for n in names if n not in needed]
    if missing or other:
        what = f"lacks {', '.join(missing)}" if missing else f"{', '.join(other)} is prescribed, not a state"
        raise SetError(f"over: {what}; the state of {scene.name} on {model.name} is {', '.join(needed)}")
    if len(names) > most:
        raise SetError(f"over: 1 to {most} states, and {scene.name} has {len(names)}")
    if scene.template.reads_time or scene.template.awaits_time:
        raise SetError(f"scene: {scene.name} depends on the time t, which is no state")
    if scene.file.goal is None:
        raise SetError(f"scene: {scene.name} has no goal")


def records_of(scene: Scene) -> rec.Records:
    """The scene's records with its literal numbers only."""
    return rec.views(scene.template.buffer, scene.template.counts)


def undriven(scene: Scene, names: Sequence[str]) -> list[int]:
    """Places in `names` of coordinates that nothing drives."""
    drives = dict(zip(scene.template.coordinates, records_of(scene).coordinates["drive"], strict=True))
    return [k for k, name in enumerate(names) if drives.get(name) == rec.NO_DRIVE]


def columns_of(scene: Scene, names: Sequence[str]) -> Ints:
    """Columns (d,) of states among all coordinates and then all speeds."""
    return np.array([_column(scene, name) for name in names], np.int64)


def box_of_states(
    scene: Scene,
    values: Mapping[str, float],
    names: Sequence[str],
    box: Mapping[str, tuple[float, float]] | None,
) -> tuple[Reals, Reals]:
    """Intervals (d, 2) of states, as given or of their travel, and their travel (d, 2). Raises SetError."""
    given = {state_name(scene, name): interval for name, interval in (box or {}).items()}
    coordinates = scene.bind(values).records.coordinates
    limits = dict(
        zip(
            scene.template.coordinates,
            zip(coordinates["lower"], coordinates["upper"], strict=True),
            strict=True,
        )
    )
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


def input_box(scene: Scene, inputs: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
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


def without_doomed(scene: Scene) -> Scene:
    """The scene without its own rule for doomed states."""
    data = scene.file.model_dump(mode="json")
    data.pop("doomed", None)
    return load(data)
