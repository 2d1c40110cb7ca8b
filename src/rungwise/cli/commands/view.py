"""`rungwise view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rungwise.cli.arguments import (
    ForceOption,
    JsonOption,
    LimitOption,
    SetOption,
    SettleOption,
    load_plan_file,
    load_with,
    numeric,
    rung,
    unused_files,
)
from rungwise.cli.terminal import plain_errors, refuse, show, show_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rungwise.deadline import Deadline
    from rungwise.scene.contract import AnyScene
    from rungwise.simulation.any_run import AnyRun


def view(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="DIR|SCENE|PLAN...",
            help="Folders of runs or sets, or one scene, or one saved plan (JSON).",
        ),
    ],
    model: Annotated[
        list[str] | None,
        rung("Rung to run on; may be repeated. All that move, or the plan's own, if not given."),
    ] = None,
    values: SetOption = None,
    settle: SettleOption = False,
    html: Annotated[Path | None, typer.Option("--html", help="Page in one file, for a browser.")] = None,
    png: Annotated[
        Path | None, typer.Option("--png", help="Picture: a strip of frames of runs, or slices of sets.")
    ] = None,
    gif: Annotated[Path | None, typer.Option("--gif", help="Short animation as a picture.")] = None,
    frames: Annotated[int, typer.Option("--frames", help="Number of frames of the strip.")] = 6,
    at: Annotated[float | None, numeric("--at", "Time of the one frame in the PNG.")] = None,
    parting: Annotated[
        Path | None,
        typer.Option(
            "--parting",
            help="Still picture of when a plan's motions on two rungs begin to differ: the rungs of --model,"
            " or those of its diagnosis whose motions come farthest apart.",
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option("--live", help="Serve a page of runs in space until Ctrl-C (needs the extra watch)."),
    ] = False,
    limit: LimitOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> int:
    """Draw runs, plans or sets. A scene or a plan is run on several rungs, which are drawn side by side. The
    command writes SCENE.html if no file is named.

    Example: rungwise view two_finger --set v2=0.7"""
    from rungwise.deadline import Deadline, seconds
    from rungwise.viewing.view import view as draw
    from rungwise.viewing.write import ViewError

    if parting is not None:
        if html or png or gif or values:
            refuse("view: --parting is a picture of its own; it goes with --model and --at alone")
        unused_files(force, parting=parting)
        return _parting(sources, model, parting, at, limit, as_json)
    unused_files(force, html=html, png=png, gif=gif)
    is_named = live or any(file is not None for file in (html, png, gif))
    with plain_errors():
        deadline = Deadline(seconds(limit))
    folders = [Path(source) for source in sources if Path(source).is_dir()]
    runs: list[AnyRun] = []
    if folders and (len(folders) < len(sources) or model or values):
        refuse("view: give folders of saved runs, or one scene with --model and --set")
    if not folders:
        if len(sources) > 1:
            refuse(f"view: {sources[1]!r} is no folder; give folders of saved runs, or one scene")
        is_plan = Path(sources[0]).suffix == ".json"
        if is_plan:
            runs = _replays(sources[0], model, values, deadline, force or is_named)
        else:
            runs = _runs(sources[0], model, values, settle, deadline, force or is_named)
    if live:
        return _live(runs)
    try:
        written = draw(
            folders or runs, html=html, png=png, gif=gif, frames=frames, at=at, limit=deadline.seconds,
            overwrite=force or is_named,
        )  # fmt: skip
    except ViewError as error:
        refuse(str(error))
    outcomes = [{"model": run.model.name, "outcome": str(run.outcome)} for run in runs]
    if as_json:
        show_json({"files": [str(file) for file in written], "runs": outcomes})
    else:
        show(
            "\n".join(
                [*(f"{o['model']}: {o['outcome']}" for o in outcomes), *(f"wrote {f}" for f in written)]
            )
        )
    return 0


def _live(runs: Sequence[AnyRun]) -> int:
    """Serve a page of runs in space until Ctrl-C."""
    from rungwise.errors import InputError
    from rungwise.viewing.drawers import drawer_of

    try:
        live = {drawer_of(run.scene).live for run in runs}
        serve = live.pop() if len(live) == 1 else None
        if serve is None:
            refuse("view: --live shows runs of one scene in space")
        with serve([drawer_of(run.scene).clip(run) for run in runs]) as page:
            show(f"{page.url} (Ctrl-C ends it)")
            page.wait()
    except InputError as error:
        refuse(str(error))
    return 0


def _parting(
    sources: list[str], models: list[str] | None, file: Path, at: float | None, limit: float | None,
    as_json: bool,
) -> int:  # fmt: skip
    """Draw where the motions of a plan part on two rungs, and tell it."""
    from rungwise.deadline import Deadline, seconds
    from rungwise.planning.diagnosis.diagnose import diagnose
    from rungwise.planning.diagnosis.sentences import UNTOUCHED
    from rungwise.planning.plan import PLACES_ONLY
    from rungwise.viewing.drawers import drawer_of

    if len(sources) > 1 or Path(sources[0]).suffix != ".json" or len(models or "ab") != 2:
        refuse("parting: needs one saved plan (JSON) and two rungs, or none")
    with plain_errors():
        deadline = Deadline(seconds(limit))
        plan = load_plan_file(Path(sources[0]))
        if plan.stage is not None and not plan.stage.model.moves:
            refuse(f"plan: {PLACES_ONLY}")
        if models:
            if not plan.found:
                refuse(f"plan: there is none. {plan.reason}")
            found = diagnose(
                plan.scene, *models, inputs=plan.segments, parameters=plan.parameters, tol=plan.tol,
                limit=deadline.share(2),
            )  # fmt: skip
        elif moving := [each for each in plan.diagnosis if UNTOUCHED not in each.causes]:
            found = max(moving, key=lambda each: each.distance)
        else:
            refuse(
                "parting: the plan's motions are the same on all of its stages; name two rungs with --model"
            )
        draw = drawer_of(plan.scene).parting
        if draw is None:
            refuse("parting: is drawn for planar plans only")
        written = draw(found, plan.scene, file, parameters=plan.parameters, at=at, limit=deadline.seconds)
    if as_json:
        show_json({"files": [str(written)], "diagnosis": found.summary()})
    else:
        show(f"{found}\nwrote {written}")
    return 0


def _unused_page(scene: AnyScene, force: bool) -> None:
    """Refuse the page that is written where no file is named, if it exists, before anything is run."""
    unused_files(force, html=Path(f"{scene.name}.html"))


def _replays(
    source: str, models: list[str] | None, values: list[str] | None, deadline: Deadline, force: bool
) -> list[AnyRun]:
    """The runs of a saved plan on its own rung, or on the rungs given, each in its share of the time."""
    if values:
        refuse("view: --set is for scenes; a plan has its parameters")
    with plain_errors():
        plan = load_plan_file(Path(source))
        if not plan.found:
            refuse(f"plan: there is none. {plan.reason}")
        _unused_page(plan.scene, force)
        names = models or [plan.summary()["model"]]
        return [plan.replay(name, limit=deadline.share(len(names) - k)) for k, name in enumerate(names)]


def _runs(
    source: str,
    models: list[str] | None,
    values: list[str] | None,
    settle: bool,
    deadline: Deadline,
    force: bool,
) -> list[AnyRun]:
    """The scene's run on each of the rungs, for pictures; each may take its share of the time."""
    from rungwise.models.ladder import LADDER
    from rungwise.world.run import simulate

    with plain_errors():
        scene, parameters = load_with(source, values, settle)
        _unused_page(scene, force)
        chosen = models or [rung.name for rung in LADDER if rung.moves]
        runs = [
            simulate(scene, name, parameters=parameters, limit=deadline.share(len(chosen) - k))
            for k, name in enumerate(chosen)
        ]
    for run in runs:
        if run.outcome.name == "invalid":
            refuse(run.reason)
    return runs
