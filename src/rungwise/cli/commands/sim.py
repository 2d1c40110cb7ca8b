"""`rungwise sim`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import INTERRUPTED, plain_errors, refuse, show, show_json, writable_to

if TYPE_CHECKING:
    from rungwise.simulation.any_run import AnyRun


def sim(
    scene: arg.SceneArgument,
    model: Annotated[
        str,
        arg.rung("Rung of the ladder (see `rungwise models`)."),
    ],
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    step: Annotated[
        float | None, arg.numeric("--step", "Length of a step; the scene's own if not given.")
    ] = None,
    tol: arg.TolOption = None,
    duration: arg.TimeOption = None,
    theta: Annotated[
        float, arg.numeric("--theta", "Theta rule on the dynamic-compliant rung, 0.5 to 1.")
    ] = 1.0,
    inertia: Annotated[
        float | None, arg.numeric("--inertia", "The paper's epsilon, 0 to 1, in place of the rung's own.")
    ] = None,
    inputs: Annotated[
        Path | None,
        arg.path("--inputs", "YAML file: a list of segments for the scene's inputs over time."),
    ] = None,
    limit: arg.LimitOption = None,
    save_hard: Annotated[
        Path | None,
        arg.path("--save-hard", "Folder for the problems of hard steps, at most 101 (FCLIB)."),
    ] = None,
    out: Annotated[Path | None, arg.path("--out", "Folder for trajectory and summary.")] = None,
    force: arg.ForceOption = False,
    as_json: arg.JsonOption = False,
) -> int:
    """Run a scene on one rung to its outcome.

    Example: rungwise sim gripper --model dynamic-rigid --set mu=0.3"""
    from rungwise.deadline import Deadline, seconds
    from rungwise.models.ladder import rung
    from rungwise.simulation.options import ModelError
    from rungwise.world.run import simulation_of

    if step is not None and tol is not None:
        refuse("step and tol: give one of the two")
    with plain_errors():
        deadline = Deadline(seconds(limit))
        loaded = arg.load_scene(scene, settle)
        try:
            chosen = rung(model) if inertia is None else rung(model).with_inertia(inertia)
        except ValueError as error:
            raise ModelError(str(error)) from None
        parameters = arg.parameters_of(loaded, values)
        if out is not None:
            arg.writable(out)
            arg.unused(out, force)
        arg.unused_files(force, save_hard=save_hard)
        if force and save_hard is not None:
            for held in save_hard.glob("*.hdf5"):
                held.unlink()
        simulation = simulation_of(
            loaded, chosen, parameters=parameters, step=step, tol=tol, duration=duration, theta=theta,
            inputs=None if inputs is None else _schedule(inputs), save_hard=save_hard,
        )  # fmt: skip
        try:
            interrupted = progress.watch(simulation, deadline, as_json)
        except OSError as error:
            refuse(f"save_hard: {save_hard} cannot be written ({error.strerror or error})")
    run = simulation.result()
    if run.outcome.name == "invalid":
        refuse(run.reason)
    if out is not None:
        with writable_to(out):
            run.save(out)
    show_json(run.summary()) if as_json else show(_sentence(run))
    return INTERRUPTED if interrupted else run.outcome.exit_code


def _sentence(run: AnyRun) -> str:
    final = ", ".join(f"{b}.{c} = {x:.6g}" for b, many in run.final.items() for c, x in many.items())
    lines = [
        f"{run.scene.name} on {run.model.name}: {run.outcome}",
        f"  {run.reason}",
        f"  time {run.time:.6g} after {run.steps} steps, worst residual {run.worst_residual:.1e},"
        f" {run.wall_s:.3f} s",
        f"  {final}",
    ]
    if run.energy_gained > 0.0:
        lines.append(
            f"  contacts added {run.energy_gained:.3g} of energy: Newton's restitution with friction can do"
            " this; a compliant rung cannot"
        )
    return "\n".join([*lines, *(f"  {note}" for note in run.notes)])


def _schedule(path: Path) -> Any:
    """What the file says of the inputs; an empty one, that says nothing, is refused."""
    from rungwise.scene.scene import read_yaml

    content = read_yaml("inputs", path)
    if content is None:
        refuse(f"inputs: {str(path)!r} is empty; it must be a list of segments")
    return content
