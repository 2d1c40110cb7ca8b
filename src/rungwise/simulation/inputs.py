"""Inputs over time: schedules of segments, held, ramped, or ended by a condition."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from rungwise.content import ByContent
from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.scene import Scene, SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import finite, shown
from rungwise.scene.language.expression import CONDITIONS, STACK, TIMES, Code, Programs, evaluate
from rungwise.scene.language.names import with_times
from rungwise.scene.template.template import Followed
from rungwise.simulation.watched.held_since import STATED
from rungwise.simulation.watched.inputs import Inputs
from rungwise.wording import choices

MOST = 10_000
"""Most segments of a schedule."""


class ScheduleError(InputError):
    """A schedule of inputs is wrong; the text is one line that names the field."""


@dataclass(frozen=True, eq=False)
class Segment(ByContent):
    """A part of a schedule: values of inputs by name (an input not named stays as it is), and its duration.

    A segment with `ramp` changes the inputs linearly to the values, over the duration. One with `until` ends
    as soon as that condition holds, in the names of the scene ("force(left, part) >= 5"); if it does not
    hold within the duration, the run ends.
    """

    inputs: Mapping[str, float] = field(default_factory=dict)
    duration: float = math.nan
    until: str | None = None
    ramp: bool = False


Schedule: TypeAlias = "Sequence[Segment | Mapping[str, Any]]"
"""Segments one after the other, or mappings of their fields."""


def read_schedule(scene: AnyScene, given: Schedule) -> tuple[Segment, ...]:
    """The segments of a schedule, checked against the scene's inputs. Raises ScheduleError."""
    if isinstance(given, str | bytes | Mapping) or not isinstance(given, Iterable):
        raise ScheduleError(f"inputs: must be a list of segments, not {shown(given)}")
    segments = tuple(_segment(scene, f"inputs.{k}", each) for k, each in enumerate(given))
    if len(segments) > MOST:
        raise ScheduleError(f"inputs: must have at most {MOST} segments, not {len(segments)}")
    return segments


def _segment(scene: AnyScene, path: str, given: object) -> Segment:
    names = [f.name for f in fields(Segment)]
    if isinstance(given, Segment):
        given = {name: getattr(given, name) for name in names}
    if not isinstance(given, Mapping):
        raise ScheduleError(
            f"{path}: must be a mapping of fields, not {shown(given)}; valid: {', '.join(names)}"
        )
    for name in given:
        if name not in names:
            raise ScheduleError(f"{path}: unknown field {shown(name)}{choices(name, names)}")
    if "duration" not in given:
        raise ScheduleError(f"{path}.duration: is required")
    levels, ramp, until = given.get("inputs", {}), given.get("ramp", False), given.get("until")
    if not isinstance(levels, Mapping):
        raise ScheduleError(f"{path}.inputs: must be a mapping of names to numbers, not {shown(levels)}")
    if not isinstance(ramp, bool | np.bool_):
        raise ScheduleError(f"{path}.ramp: must be true or false, not {shown(ramp)}")
    values = {name: level(scene, f"{path}.inputs", name, value) for name, value in levels.items()}
    duration = finite(f"{path}.duration", given["duration"], ScheduleError)
    if duration < 0.0:
        raise ScheduleError(f"{path}.duration: must be >= 0, not {duration:g}")
    condition(scene, until, f"{path}.until")
    return Segment(values, duration, until, bool(ramp))


def level(scene: AnyScene, path: str, name: object, value: object) -> float:
    """The value of an input, checked. Raises ScheduleError, at the path."""
    known = scene.template.inputs
    if name not in known:
        raise ScheduleError(f"{path}: unknown input {shown(name)}{choices(name, known)}")
    number, declared = finite(f"{path}.{name}", value, ScheduleError), scene.file.parameters[str(name)].range
    if declared is not None and not declared[0] <= number <= declared[1]:
        raise ScheduleError(f"{path}.{name}: {number:g} is outside {declared[0]:g} to {declared[1]:g}")
    return number


def condition(scene: AnyScene, text: object, path: str) -> Code:
    """The program of a segment's condition, an empty one for None. Raises ScheduleError."""
    if text is None:
        return Code()
    if not isinstance(text, str):
        raise ScheduleError(f"{path}: must be text, not {shown(text)}")
    try:
        code: Code = scene.template.names().condition(text, path, "until")
        return code
    except SceneError as error:
        raise ScheduleError(str(error)) from None


def compiled(
    scene: AnyScene, durations: Reals, levels: Reals, ramps: Ints, until: Sequence[str | None]
) -> Inputs:
    """A schedule as kernels take it: durations (s,), levels (s, u), ramps (s,), and conditions or None."""
    conditions, own = [condition(scene, text, f"until.{k}") for k, text in enumerate(until)], _own(scene)
    programs, followed = Programs([*conditions, *with_times(conditions)]), own.followed
    return Inputs(
        speeds=followed.speeds, numbers=followed.numbers, timed=own.timed,
        rests=np.array([own.rests or programs.reads(own.ways)], np.int64), columns=own.columns,
        durations=durations, levels=levels, ramps=ramps,
        code=programs.code, constants=programs.constants, table=programs.table,
    )  # fmt: skip


class _Own(NamedTuple):
    """What a scene decides alone of `Inputs`, where expressions read the ways of bodies, and whether the
    scene's own conditions do."""

    followed: Followed
    timed: Ints
    columns: Ints
    ways: range
    rests: bool


@lru_cache(maxsize=64)
def _own(scene: AnyScene) -> _Own:
    template, followed = scene.template, scene.followed
    ways = template.names().ways
    return _Own(
        followed, np.array([followed.reads_time, followed.awaits_time], np.int64),
        np.array([template.parameters.index(name) for name in template.inputs], np.int64),
        ways, scene.programs.reads(ways),
    )  # fmt: skip


def compile_segments(scene: AnyScene, segments: Sequence[Segment]) -> Inputs:
    """Checked segments as kernels take them."""
    return _compiled(scene, segments) if segments else _without_segments(scene)


@lru_cache(maxsize=64)
def _without_segments(scene: AnyScene) -> Inputs:
    """The same for all runs: there is nothing in it that one writes."""
    return _compiled(scene, ())


def _compiled(scene: AnyScene, segments: Sequence[Segment]) -> Inputs:
    names = scene.template.inputs
    levels = [[segment.inputs.get(name, math.nan) for name in names] for segment in segments]
    return compiled(
        scene,
        np.array([segment.duration for segment in segments], float),
        np.array(levels, float).reshape(len(segments), len(names)),
        np.array([segment.ramp for segment in segments], np.int64),
        [segment.until for segment in segments],
    )


def impossible_times(scene: AnyScene, inputs: Inputs, values: Reals) -> str:
    """What is wrong with the times for which conditions must hold, at these values; empty if nothing is."""
    own, stack = scene.programs, np.zeros(STACK)
    spans = [
        (CONDITIONS[j // TIMES], own.code, own.constants, own.table[row])
        for j, row in enumerate(range(STATED + 1, len(own.table), 2))
    ]
    s = len(inputs.durations)
    spans += [
        (f"inputs.{j // TIMES}.until", inputs.code, inputs.constants, inputs.table[row])
        for j, row in enumerate(range(s + 1, len(inputs.table), 2))
    ]
    for path, code, constants, (first, last) in spans:
        span = evaluate(code, constants, first, last, values, stack) if last > first else 0.0
        if not 0.0 <= span < math.inf:
            return f"{path}: the time after 'for' must be finite and >= 0, not {span:g}"
    return ""


def ignored(scene: Scene, model: Rung, segments: Sequence[Segment]) -> tuple[str, ...]:
    """Remarks on inputs of a schedule that have no effect on this rung, which knows no forces."""
    remarks = []
    for name in scene.template.inputs if model.metric else ():
        paths = scene.template.readers[name]
        if any(name in segment.inputs for segment in segments) and all(map(_is_force, paths)):
            remarks.append(
                f"inputs.{name}: has no effect on the {model.name} rung, which has no forces; it is read by"
                f" {', '.join(paths)}"
            )
    return tuple(remarks)


def _is_force(path: str) -> bool:
    return path.endswith((".drive.force", ".force.0", ".force.1", ".torque"))
