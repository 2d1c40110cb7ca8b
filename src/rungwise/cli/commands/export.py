"""`rungwise export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rungwise.cli import arguments as arg
from rungwise.cli.terminal import plain_errors, refuse, show, show_json, writable_to

if TYPE_CHECKING:
    from rungwise.simulation.any_run import AnyRun

ENDINGS = {".csv": "a table of joints", ".json": "a message of joints", ".xml": "MJCF"}


def export(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SCENE|PLAN|RUN",
            autocompletion=arg.scenes,
            help="Name of a scene that ships, path of a YAML, MJCF or URDF file, a saved plan (JSON), or the"
            " folder of a saved run.",
        ),
    ],
    out: Annotated[
        Path,
        arg.path(
            "--out",
            "The file: .csv is a table of joints over time, .json the same as a message of ROS"
            " (JointTrajectory), .xml is MJCF with keyframes.",
        ),
    ],
    model: Annotated[
        str | None,
        arg.rung("Rung of the run; the plan's own, or dynamic-compliant, if not given."),
    ] = None,
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    duration: arg.TimeOption = None,
    tol: arg.TolOption = None,
    rate: Annotated[
        float | None,
        arg.numeric("--rate", "Rows per unit of time; the recorded frames if not given."),
    ] = None,
    names: Annotated[
        str | None,
        typer.Option(
            "--joints", help="Coordinates or joints, separated by commas; those of robots if not given."
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option("--at", help="Times of keyframes, separated by commas; for MJCF, the end if not given."),
    ] = None,
    keyframes: Annotated[
        bool,
        typer.Option(
            "--keyframes", help="For MJCF, write only the keyframes, to be included in your own file."
        ),
    ] = False,
    limit: arg.LimitOption = None,
    force: arg.ForceOption = False,
    as_json: arg.JsonOption = False,
) -> int:
    """Write a run, or a scene at a state, for other programs."""
    kind = out.suffix.lower()
    if kind not in ENDINGS:
        refuse(f"out: must end in {', '.join(ENDINGS)}, not {out.name[-40:]!r}")
    for name, given, known in (
        ("at", at, kind == ".xml"), ("keyframes", keyframes or None, kind == ".xml"),
        ("rate", rate, kind != ".xml"), ("joints", names, kind != ".xml"),
    ):  # fmt: skip
        if given is not None and not known:
            refuse(f"{name}: does not apply to {kind} files, which are {ENDINGS[kind]}")
    with plain_errors():
        arg.writable_file(out)
        arg.unused(out, force)
        run = _run(source, model, values, settle, {"duration": duration, "tol": tol, "limit": limit})
        if run.outcome.name == "invalid":
            refuse(run.reason)
        if kind == ".xml":
            text = run.mjcf(_times(at), whole=not keyframes)
            with writable_to(out):
                out.write_text(text, "utf-8")
        else:
            found = run.joint_trajectory(None if names is None else names.split(","), rate=rate)
            with writable_to(out):
                found.save(out)
    told = {"source": source, "outcome": str(run.outcome), "time": run.time, "written": str(out)}
    show_json(told) if as_json else show(
        f"{run.scene.name} on {run.model.name}: {run.outcome} at t = {run.time:.6g}; {ENDINGS[kind]} in {out}"
    )
    return run.outcome.exit_code if run.outcome.name != "timeout" else 0


def _run(
    source: str, model: str | None, values: list[str] | None, settle: bool, options: dict[str, Any]
) -> AnyRun:
    """The run of a scene or a plan, or one that was saved."""
    from rungwise.simulation.trajectory import SUMMARY
    from rungwise.world.run import load_run, simulate

    path = Path(source)
    if (path / SUMMARY).is_file():
        if model or values or settle:
            refuse("model, set, settle: a saved run has its own")
        return load_run(path)
    if path.suffix.lower() == ".json":
        if values or settle:
            refuse("set, settle: a plan has its own parameters")
        return arg.load_plan_file(path).replay(model, **options)
    scene, parameters = arg.load_with(source, values, settle)
    return simulate(scene, model or "dynamic-compliant", parameters=parameters, **options)


def _times(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(each) for each in text.split(",")]
    except ValueError:
        refuse(f"at: {text[:60]!r} must be times, separated by commas")
