"""`rungwise replay`."""

from __future__ import annotations

from typing import Annotated

import typer

from rungwise.cli.arguments import JsonOption, SceneArgument, SetOption, load_any_scene, number, parameters_of
from rungwise.cli.terminal import plain_errors, refuse, show, show_json


def replay(
    scene: SceneArgument,
    judge: Annotated[str, typer.Option("--in", help="The other simulator: mujoco.")] = "mujoco",
    model: Annotated[
        str, typer.Option("--model", help="Rung of the run that is replayed.")
    ] = "dynamic-compliant",
    values: SetOption = None,
    duration: Annotated[
        float | None, typer.Option("--time", parser=number, metavar="NUMBER", help="End of the run.")
    ] = None,
    tol: Annotated[
        float | None,
        typer.Option("--tol", parser=number, metavar="NUMBER", help="Error allowed per step of the run."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            "--step", parser=number, metavar="NUMBER", help="The judge's step; the model's own if not given."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Run a scene in space, give the same inputs to another simulator, and say where and why the two part."""
    from rungwise.scene import Scene
    from rungwise.simulation.run import simulate
    from rungwise.simulation.spatial.replay import replay as judged

    with plain_errors():
        loaded = load_any_scene(scene)
        if isinstance(loaded, Scene):
            refuse("scene: is planar; only scenes in space are replayed in another simulator")
        parameters = parameters_of(loaded, values)
        run = simulate(loaded, model, parameters=parameters, duration=duration, tol=tol)
        if run.outcome.name == "invalid":
            refuse(run.reason)
        found = judged(run, in_=judge, step=step)
    show_json(found.summary()) if as_json else show(str(found))
    return 0 if found.ok else 1
