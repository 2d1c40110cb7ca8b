"""`rungwise view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rungwise.cli.arguments import JsonOption, SetOption, load_scene, number, parameters_of
from rungwise.cli.terminal import plain_errors, refuse, show, show_json

if TYPE_CHECKING:
    from rungwise.simulation.result import Run


def view(
    sources: Annotated[
        list[str], typer.Argument(metavar="DIR|SCENE...", help="Folders of runs or sets, or one scene.")
    ],
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model", help="Rung to run the scene on; may be repeated. All that move if not given."
        ),
    ] = None,
    values: SetOption = None,
    html: Annotated[Path | None, typer.Option("--html", help="Animation in one file, for a browser.")] = None,
    png: Annotated[Path | None, typer.Option("--png", help="Strip of frames.")] = None,
    gif: Annotated[Path | None, typer.Option("--gif", help="Short animation as a picture.")] = None,
    frames: Annotated[int, typer.Option("--frames", help="Frames of the strip.")] = 6,
    at: Annotated[
        float | None,
        typer.Option("--at", parser=number, metavar="NUMBER", help="Time of the one frame in the PNG."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Draw saved runs or sets, or a scene's runs on several rungs over each other; SCENE.html by default."""
    from rungwise.viewing.view import ViewError
    from rungwise.viewing.view import view as draw

    folders = [Path(source) for source in sources if Path(source).is_dir()]
    runs: list[Run] = []
    if folders and (len(folders) < len(sources) or model or values):
        refuse("view: give folders of saved runs, or one scene with --model and --set")
    if not folders:
        if len(sources) > 1:
            refuse(f"view: {sources[1]!r} is no folder; give folders of saved runs, or one scene")
        runs = _runs(sources[0], model, values)
    try:
        written = draw(folders or runs, html=html, png=png, gif=gif, frames=frames, at=at)
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


def _runs(source: str, models: list[str] | None, values: list[str] | None) -> list[Run]:
    """The scene's run on each of the rungs, for pictures."""
    from rungwise.models.ladder import LADDER
    from rungwise.simulation.run import simulate

    with plain_errors():
        scene = load_scene(source)
        parameters = parameters_of(scene, values)
        chosen = models or [rung.name for rung in LADDER if rung.moves]
        runs = [simulate(scene, name, parameters=parameters) for name in chosen]
    for run in runs:
        if run.outcome.name == "invalid":
            refuse(run.reason)
    return runs
