"""Schedules of stages: by name, or as they are given."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

from rungwise.errors import InputError
from rungwise.models.ladder import LADDER, QUASISTATIC_RIGID, Rung, rung
from rungwise.planning.motion.budget import Stage
from rungwise.planning.task.fingers import with_fingers
from rungwise.planning.task.task import Task
from rungwise.scene.fields.values import shown
from rungwise.wording import choices

COARSE, FINE = 1e-2, 1e-3
"""Accuracies of stages: the error allowed per step, as a part of the size of what is moved."""
SCHEDULES = ("coarse-fine", "climb", "quasistatic", "direct")
"""Schedules by name: coarse steps on the last rung, then fine ones; all rungs from the first to the last;
fine steps on the rigid quasistatic rung, then on the last; fine steps on the last rung alone."""
Schedule: TypeAlias = "str | Sequence[Stage | tuple[str | Rung, float] | str | Rung]"


class StageError(InputError):
    """A schedule of stages is wrong; one line that names it."""


def usual(task: Task, to: Rung | str) -> str:
    """The schedule of a task that is given none: where robots push slowly, the quasistatic rung predicts what
    the last one does, in fewer steps; where fingers hold an object against its weight, it says with which
    forces. `docs/schedules.md` compares schedules on both kinds."""
    try:
        above = LADDER.index(rung(to)) > LADDER.index(QUASISTATIC_RIGID)
    except ValueError as error:
        raise StageError(str(error)) from None
    return "quasistatic" if (task.is_slow or with_fingers(task).is_led) and above else "coarse-fine"


def stages(schedule: Schedule, from_: Rung | str | None, to: Rung | str) -> list[Stage]:
    """The stages of a schedule. Raises StageError."""
    try:
        last = rung(to)
        first = None if from_ is None else rung(from_)
        if not isinstance(schedule, str):
            if not isinstance(schedule, Iterable):
                raise ValueError(f"schedule: must be a name or stages, not {shown(schedule)}")
            listed = [_stage(each) for each in schedule]
            if not listed:
                raise ValueError("schedule: needs at least one stage")
            return listed
        if schedule not in SCHEDULES:
            raise ValueError(f"schedule: unknown {shown(schedule)}{choices(schedule, SCHEDULES)}")
        if not last.moves:
            return [Stage(last, COARSE)]
        if first is not None or schedule == "climb":
            low = 0 if first is None else LADDER.index(first)
            climbed = LADDER[low : LADDER.index(last) + 1]
            if not climbed:
                raise ValueError(f"from: {from_} is above {last.name}")
            return [*(Stage(each, COARSE) for each in climbed), Stage(last, FINE)]
    except ValueError as error:
        raise StageError(str(error)) from None
    chosen = {
        "coarse-fine": [Stage(last, COARSE), Stage(last, FINE)],
        "quasistatic": [Stage(QUASISTATIC_RIGID, FINE), Stage(last, FINE)],
        "direct": [Stage(last, FINE)],
    }
    return chosen[schedule]


def _stage(given: Any) -> Stage:
    match given:
        case Stage():
            found = given
        case (model, float() | int() as tol) if tol > 0.0:
            found = Stage(rung(model), float(tol))
        case str() | Rung():
            found = Stage(rung(given), FINE)
        case _:
            raise ValueError(
                f"schedule: a stage must be a rung, or a rung and an accuracy, not {shown(given)}"
            )
    return found
