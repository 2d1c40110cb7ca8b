"""`rungwise replay`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from rungwise.cli.arguments import (
    JsonOption,
    LimitOption,
    SetOption,
    TimeOption,
    TolOption,
    load_plan_file,
    load_scene,
    numeric,
    parameters_of,
    rung,
    scenes,
)
from rungwise.cli.terminal import answer, plain_errors, refuse

if TYPE_CHECKING:
    from rungwise.simulation.any_run import AnyRun
    from rungwise.simulation.spatial.result import SpaceRun

ELSEWHERE = "scene: is not in space; only scenes in space are replayed in another simulator"


def replay(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE|PLAN",
            autocompletion=scenes,
            help="Name of a scene that ships, path of a YAML, MJCF or URDF file, or a saved plan (JSON).",
        ),
    ],
    judge: Annotated[str, typer.Option("--in", help="The other simulator: mujoco.")] = "mujoco",
    model: Annotated[
        str | None,
        rung("Rung of the run that is replayed; the plan's own, or dynamic-compliant, if not given."),
    ] = None,
    values: SetOption = None,
    duration: TimeOption = None,
    tol: TolOption = None,
    step: Annotated[
        float | None, numeric("--step", "The judge's step; the model's own if not given.")
    ] = None,
    limit: LimitOption = None,
    as_json: JsonOption = False,
) -> int:
    """Compare a run in space with another simulator, which gets the same start and inputs. The answer says
    when and why the two motions begin to differ.

    Example: rungwise replay slope --in mujoco --model dynamic-rigid"""
    from rungwise.deadline import Deadline, seconds
    from rungwise.simulation.spatial.replay import replay as judged

    with plain_errors():
        deadline = Deadline(seconds(limit))
        options = {"duration": duration, "tol": tol, "limit": deadline.share(2)}
        run = _planned(scene, model, values, options)
        if run is None:
            run = _run(scene, model, values, options)
        if run.outcome.name == "invalid":
            refuse(run.reason)
        found = judged(cast("SpaceRun", run), in_=judge, step=step, limit=deadline.seconds)
    answer(found, as_json)
    return 0 if found.ok else 1


def _planned(
    source: str, model: str | None, values: list[str] | None, options: dict[str, Any]
) -> AnyRun | None:
    """The run of a saved plan; None for a scene."""
    from rungwise.world.contract import SOLIDS
    from rungwise.world.find import world_of

    if Path(source).suffix.lower() != ".json":
        return None
    if values:
        refuse("set: a plan has its own parameters")
    plan = load_plan_file(Path(source))
    run = plan.replay(model, **options)
    if world_of(run.scene).shapes != SOLIDS:
        refuse(ELSEWHERE)
    return run


def _run(source: str, model: str | None, values: list[str] | None, options: dict[str, Any]) -> AnyRun:
    """The run of a scene."""
    from rungwise.world.contract import SOLIDS
    from rungwise.world.find import world_of
    from rungwise.world.run import simulate

    loaded = load_scene(source)
    if world_of(loaded).shapes != SOLIDS:
        refuse(ELSEWHERE)
    run: AnyRun = simulate(
        loaded,
        model or "dynamic-compliant",
        parameters=parameters_of(loaded, values),
        **options,
    )
    return run
