"""Results as notebooks show them: a small table and a picture; and pictures as matplotlib knows them."""

from __future__ import annotations

import base64
import html
from importlib.util import find_spec
from io import BytesIO
from typing import TYPE_CHECKING, cast

from rungwise.deadline import seconds
from rungwise.errors import InputError
from rungwise.keywords import keywords
from rungwise.outcome import Outcome
from rungwise.plain import cut, table
from rungwise.planning.design.design import Design
from rungwise.planning.plan import Plan
from rungwise.scene.fields.values import shown
from rungwise.sets.doomed.doomed import DoomedSet
from rungwise.sets.feasible.feasible import FeasibleSet
from rungwise.simulation.any_run import AnyRun
from rungwise.viewing.designs import design_bars
from rungwise.viewing.drawers import DRAWERS
from rungwise.viewing.sets.slices import doomed_slices, feasible_slices

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INLINE, HEIGHT = 1_500_000, 560
"""Most bytes of an animation in a notebook, and its height in pixels."""
Shown = AnyRun | Plan | Design | FeasibleSet | DoomedSet


class PictureError(InputError):
    """A picture cannot be made; the text is one line that says why."""


@keywords
def plot(result: Shown, *, frames: int = 6, limit: float | None = None) -> Figure:
    """Draw a `result`: `frames` frames of a run or of a plan's run, slices of a set over its first two axes,
    or how far the values of a design may drift. A plan is run for the picture, for at most `limit` seconds;
    if they are not enough, the picture shows the run so far and calls it `running`.

    Raises PictureError where there is nothing to draw, or matplotlib is missing.
    """
    limit = seconds(limit)
    if not isinstance(result, Shown):
        raise PictureError(f"plot: must be a run, a plan, a set or a design, not {shown(result)}")
    if find_spec("matplotlib") is None:
        raise PictureError("plot: needs matplotlib (pip install 'rungwise[view]')")
    if isinstance(result, FeasibleSet):
        return feasible_slices([result])
    if isinstance(result, DoomedSet):
        return doomed_slices(result)
    if isinstance(result, Design):
        if not result.found:
            raise PictureError(f"plot: {result.reason}")
        return design_bars(result)
    if isinstance(frames, bool) or not isinstance(frames, int) or not 1 <= frames <= 100:
        raise PictureError(f"frames: must be a whole number in 1..100, not {shown(frames)}")
    if isinstance(result, Plan):
        if not result.found:
            raise PictureError(f"plot: there is no plan: {result.reason}")
        return _strip(result.replay(limit=limit), frames)
    if result.outcome == Outcome.INVALID:
        raise PictureError(f"plot: the run did not begin: {result.reason}")
    return _strip(result, frames)


def _strip(run: AnyRun, frames: int) -> Figure:
    if run.scene.world not in DRAWERS:
        raise PictureError(f"plot: there are no pictures of runs in {run.scene.world}")
    drawer = DRAWERS[run.scene.world]
    if drawer.strip is None:
        raise PictureError(f"plot: {drawer.runs} are drawn by rungwise.view, as html")
    return cast("Figure", drawer.strip([drawer.clip(run)], frames))


@keywords
def to_html(result: AnyRun | Plan | FeasibleSet | DoomedSet, *, limit: float | None = None) -> str:
    """A fragment of HTML: a small table of a `result`, and below it the animation of a run or the slices of a
    set. `limit` as for `plot`.

    Raises PictureError for anything else."""
    limit = seconds(limit)
    if isinstance(result, AnyRun):
        return _table_of_run(result) + (_animation(result) if result.began else "")
    if isinstance(result, Plan):
        run = result.replay(limit=limit) if result.found else None
        return _table_of_plan(result) + ("" if run is None else _animation(run))
    if not isinstance(result, FeasibleSet | DoomedSet):
        raise PictureError(f"to_html: must be a run, a plan or a set, not {shown(result)}")
    return _table_of_set(result) + ("" if find_spec("matplotlib") is None else _picture(plot(result)))


def _table_of_run(run: AnyRun) -> str:
    final = [(f"{body}.{name}", f"{x:.6g}") for body, many in run.final.items() for name, x in many.items()]
    rows = [
        ("outcome", str(run.outcome)),
        ("reason", run.reason),
        ("time", f"{run.time:.6g} after {run.steps} steps"),
        ("worst residual", f"{run.worst_residual:.1e}"),
        *final[:12],
        *(("note", note) for note in run.notes),
    ]
    return table(cut(f"{run.scene.name} on {run.model.name}", 120), rows)


def _table_of_plan(plan: Plan) -> str:
    about = [("reason", plan.reason)] if not plan.found else []
    if plan.found:
        about = [("moves", f"{len(plan.waypoints)}, {plan.duration:.4g} long"), ("cost", f"{plan.cost:.4g}")]
    stages = [(each.stage, f"{each.how}, {each.steps} steps, {each.seconds:.2f} s") for each in plan.records]
    return table(cut(f"plan of {plan.scene.name}", 120), [*about, *stages])


def _table_of_set(found: FeasibleSet | DoomedSet) -> str:
    volumes = found.volumes() if isinstance(found, FeasibleSet) else found.volumes
    runs = found.evaluations if isinstance(found, FeasibleSet) else found.runs
    sides = [f"{low:.4g} to {high:.4g}" for low, high in found.box.tolist()]
    rows = [
        *zip(found.over, sides, strict=True),
        *((label, f"{part:.4f}") for label, part in volumes.items()),
    ]
    return table(cut(f"{found.scene.name} on {found.model.name}", 120), [*rows, ("runs", runs)])


def _animation(run: AnyRun) -> str:
    """The page of a run in a frame; nothing of a world without pictures."""
    if run.scene.world not in DRAWERS:
        return ""
    drawer = DRAWERS[run.scene.world]
    content = html.escape(drawer.page([drawer.clip(run)], INLINE), quote=True)
    return f'<iframe srcdoc="{content}" style="width:100%;height:{HEIGHT}px;border:0"></iframe>'


def _picture(figure: Figure) -> str:
    image = BytesIO()
    figure.savefig(image, format="png")
    return f'<img src="data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}">'
