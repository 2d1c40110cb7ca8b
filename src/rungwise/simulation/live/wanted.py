"""What a run is told for its next time: inputs as a mapping or as an array, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.simulation.inputs import ScheduleError, Segment, level
from rungwise.simulation.options import positive
from rungwise.wording import listed

Wanted: TypeAlias = "Mapping[str, float] | Sequence[float] | Reals | None"
"""Inputs by name, the others staying as they are; or all of them (u,), in the scene's order; None: none."""


def segment_of(scene: AnyScene, wanted: Wanted, duration: object, ramp: bool) -> Segment:
    """A segment with these inputs. Raises ScheduleError, and ModelError for a duration."""
    names = scene.template.inputs
    lasts = positive("duration", duration)
    if not isinstance(ramp, bool | np.bool_):
        raise ScheduleError(f"ramp: must be true or false, not {shown(ramp)}")
    if not isinstance(wanted, Mapping | None):
        wanted = _by_name(wanted, names)
    values = {name: level(scene, "inputs", name, value) for name, value in (wanted or {}).items()}
    return Segment(values, lasts, None, bool(ramp))


def _by_name(wanted: object, names: Sequence[str]) -> dict[str, float]:
    """All inputs by name, from an array (u,). Raises ScheduleError."""
    if not isinstance(wanted, str | bytes):
        try:
            row = np.asarray(wanted, float)
        except (TypeError, ValueError):
            row = None
        if row is not None and row.shape == (len(names),):
            return dict(zip(names, row.tolist(), strict=True))
    shape = f"of shape {np.shape(wanted)}" if isinstance(wanted, np.ndarray) else shown(wanted)
    raise ScheduleError(
        f"inputs: must be a mapping of names to numbers, or an array of shape ({len(names)},) for"
        f" {listed(names)}, not {shape}"
    )
