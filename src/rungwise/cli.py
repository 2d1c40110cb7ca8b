"""Command line: every command prints text, or one JSON object with --json.

Exit codes: 0 the answer is positive, 1 it is negative, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from rungwise.scene import Scene
    from rungwise.simulation.run import Run, Simulation


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"must be a number, not {str(text)[:60]!r}") from None


app = typer.Typer(
    name="rungwise",
    help="Plan manipulation with contact models of every fidelity.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
SceneArgument = Annotated[str, typer.Argument(help="Name of a scene that ships, or path of a YAML file.")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", help="name=value of a parameter; may be repeated.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
BAD_INPUT = 2
INTERRUPTED = 130
_USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""The base of click's errors, wherever this version of typer takes click from."""


def main() -> None:
    """Entry point: errors of use are one line and exit code 2, too."""
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    try:
        code = app(standalone_mode=False)
    except _USAGE_ERROR as error:
        _refuse(" ".join(error.format_message().split()))
    except (typer.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED)
    sys.exit(code if isinstance(code, int) else 0)


def _refuse(message: str) -> NoReturn:
    print(f"rungwise: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(BAD_INPUT)


def _print(text: str) -> None:
    """Print; a reader who leaves early ends the program quietly, a full disk with one line."""
    try:
        print(text.encode(sys.stdout.encoding, "replace").decode(sys.stdout.encoding), flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            sys.exit(1)
        _refuse(f"output: cannot be written ({error.strerror or error})")


def _print_json(value: object, indent: int | None = None) -> None:
    from rungwise.plain import json_text

    _print(json_text(value, indent))


@contextmanager
def _plain_errors() -> Iterator[None]:
    """Wrong input of any kind becomes one line."""
    from rungwise.scene import SceneError
    from rungwise.sets.store import SetError
    from rungwise.simulation.run import ModelError
    from rungwise.viewing.view import ViewError

    try:
        yield
    except (SceneError, ModelError, SetError, ViewError) as error:
        _refuse(str(error))


@app.command()
def models(as_json: JsonOption = False) -> int:
    """The ladder: six contact models, what each keeps, and its equation in the paper."""
    from dataclasses import asdict

    from rungwise.models.ladder import LADDER

    if as_json:
        _print_json({"models": [asdict(rung) for rung in LADDER]})
        return 0
    _print("\n".join(f"{rung.name:22s} ({rung.equation})  {rung.about}" for rung in LADDER))
    return 0


@app.command()
def scenes(
    as_json: JsonOption = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of scene files.")] = False,
) -> int:
    """The scenes that ship."""
    from rungwise.scene import load, shipped
    from rungwise.scene import schema as scene_schema

    if schema:
        _print_json(scene_schema(), indent=None if as_json else 1)
        return 0
    known = {name: load(name).file.about for name in shipped()}
    if as_json:
        _print_json({"scenes": known})
        return 0
    _print("\n".join(f"{name:22s} {about}" for name, about in known.items()))
    return 0


@app.command()
def check(scene: SceneArgument, values: SetOption = None, as_json: JsonOption = False) -> int:
    """Validate a scene; print its bodies, coordinates, contacts and parameters."""
    from rungwise.models.ladder import KINEMATIC
    from rungwise.outcome import Code
    from rungwise.report.describe import describe, describe_text
    from rungwise.simulation.run import Simulation

    with _plain_errors():
        loaded = _load(scene)
        parameters = _parameters(loaded, values)
        report = describe(loaded, parameters)
        start = Simulation(loaded, KINEMATIC, parameters=parameters, frames=3)
    if start.outcome == Code.INVALID:
        _refuse(start.reason)
    _print_json(report) if as_json else _print(describe_text(report))
    return 0


@app.command()
def sim(
    scene: SceneArgument,
    model: Annotated[str, typer.Option("--model", help="Rung of the ladder (see `rungwise models`).")],
    values: SetOption = None,
    step: Annotated[
        float | None,
        typer.Option(
            "--step", parser=_number, metavar="NUMBER", help="Length of a step; the scene's own if not given."
        ),
    ] = None,
    tol: Annotated[
        float | None,
        typer.Option(
            "--tol", parser=_number, metavar="NUMBER", help="Error allowed per step: step lengths are chosen."
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            "--time", parser=_number, metavar="NUMBER", help="End of the run; the scene's own if not given."
        ),
    ] = None,
    theta: Annotated[
        float,
        typer.Option(
            "--theta",
            parser=_number,
            metavar="NUMBER",
            help="Theta rule on the dynamic-compliant rung, 0.5 to 1.",
        ),
    ] = 1.0,
    inertia: Annotated[
        float | None,
        typer.Option(
            "--inertia",
            parser=_number,
            metavar="NUMBER",
            help="The paper's epsilon, 0 to 1, in place of the rung's own.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for trajectory and summary.")] = None,
    as_json: JsonOption = False,
) -> int:
    """Run a scene on one rung to its outcome."""
    from rungwise.models.ladder import rung
    from rungwise.simulation.run import ModelError, Simulation

    if step is not None and tol is not None:
        _refuse("step and tol: give one of the two")
    with _plain_errors():
        loaded = _load(scene)
        try:
            chosen = rung(model) if inertia is None else rung(model).with_inertia(inertia)
        except ValueError as error:
            raise ModelError(str(error)) from None
        parameters = _parameters(loaded, values)
        if out is not None:
            _writable(out)
        _announce_compilation()
        simulation = Simulation(
            loaded, chosen, parameters=parameters, step=step, tol=tol, duration=duration, theta=theta
        )
        interrupted = _watch(simulation, quiet=as_json or not sys.stderr.isatty())
    run = simulation.result()
    if run.outcome.name == "invalid":
        _refuse(run.reason)
    if out is not None:
        try:
            run.save(out)
        except OSError as error:
            _refuse(f"out: {out} cannot be written ({error.strerror or error})")
    _print_json(run.summary()) if as_json else _print(_sentence(run))
    return INTERRUPTED if interrupted else run.outcome.exit_code


@app.command()
def sets(
    scene: SceneArgument,
    model: Annotated[str, typer.Option("--model", help="Rung of the ladder, or all.")],
    over: Annotated[
        str, typer.Option("--over", help="Parameters, NAME or NAME=LOW:HIGH, separated by commas.")
    ],
    values: SetOption = None,
    tol: Annotated[
        float,
        typer.Option(
            "--tol", parser=_number, metavar="NUMBER", help="Accuracy of the boundary, as a part of the box."
        ),
    ] = 0.01,
    accuracy: Annotated[
        float | None,
        typer.Option("--accuracy", parser=_number, metavar="NUMBER", help="Error allowed per step of a run."),
    ] = None,
    probes: Annotated[int | None, typer.Option("--probes", min=0, help="Random points per round.")] = None,
    budget: Annotated[int | None, typer.Option("--budget", min=1, help="Greatest number of runs.")] = None,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, help="Threads; all cores if not given.")
    ] = None,
    certify: Annotated[
        int, typer.Option("--certify", min=0, help="Fresh random points that test the result.")
    ] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for batches, sets and the figure.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the batches kept in --out.")] = False,
    html: Annotated[
        Path | None, typer.Option("--html", help="Surfaces, slices and runs in one file, for a browser.")
    ] = None,
    table: Annotated[
        Path | None, typer.Option("--csv", help="Table of all runs and boundary points.")
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option("--mesh", help="Boundary of the feasible part, .obj or .stl; over 2 or 3 parameters."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Where in a box of parameters a scene ends in its goal, and how it ends elsewhere."""
    from importlib.util import find_spec

    from rungwise.models.ladder import LADDER
    from rungwise.report import files
    from rungwise.report import sets as report
    from rungwise.sets.feasible import BUDGET, FeasibleSet, feasible_set
    from rungwise.viewing.view import view

    if resume and out is None:
        _refuse("resume: needs --out, the folder to go on in")
    names, box = _axes(over)
    rungs = [rung.name for rung in LADDER if rung.moves] if model == "all" else [model]
    found: list[FeasibleSet] = []
    wanted = {"csv": table, "mesh": mesh}
    try:
        with _plain_errors():
            files.check(wanted, len(names))
            loaded = _load(scene)
            parameters = _parameters(loaded, values)
            if out is not None:
                _writable(out)
            _announce_compilation("rungwise.simulation.samples", "run_samples")
            for name in rungs:
                with _counting(name, quiet=as_json or not sys.stderr.isatty()) as on_progress:
                    found.append(
                        feasible_set(
                            loaded, name, names, tol=tol, box=box, parameters=parameters, accuracy=accuracy,
                            probes=probes, budget=BUDGET if budget is None else budget, threads=threads,
                            out=None if out is None else out / name, resume=resume, on_progress=on_progress,
                        )
                    )  # fmt: skip
            summary = report.summary(found, certify)
            written = files.write(found, wanted)
            if html is not None:
                written += view(found, html=html)
            if out is not None and find_spec("matplotlib") is not None:
                report.figure(found, out / "sets.png")
    except KeyboardInterrupt:
        kept = "nothing is kept without --out" if out is None else f"--resume goes on from what {out} keeps"
        print(f"rungwise: stopped; {kept}", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        _refuse(f"out: {out} cannot be written ({error.strerror or error}); finished batches are kept")
    summary["files"] = [str(file) for file in written]
    _print_json(summary) if as_json else _print(report.text(summary))
    return 0 if any("feasible" in each["volumes"] for each in summary["sets"]) else 1


def _axes(over: str) -> tuple[list[str], dict[str, tuple[float, float]]]:
    """Names, and the intervals that are given, of NAME or NAME=LOW:HIGH, separated by commas."""
    names, box = [], {}
    for item in over.split(","):
        name, equals, interval = (part.strip() for part in item.partition("="))
        names.append(name)
        if equals:
            low, _, high = interval.partition(":")
            try:
                box[name] = float(low), float(high)
            except ValueError:
                _refuse(f"over: {item[:60]!r} must be NAME or NAME=LOW:HIGH")
    return names, box


@contextmanager
def _counting(name: str, quiet: bool) -> Iterator[Callable[[str, int, int], None] | None]:
    """A bar of runs done over runs known to be needed, with the time left; they grow with each level."""
    if quiet:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=None)
        yield lambda what, done, known: bar.update(
            task, description=f"{name}: {what}", completed=done, total=known
        )


@app.command()
def solve(
    file: Annotated[Path, typer.Argument(help="FCLIB HDF5, text of Siconos' numerics, or ContactBench npz.")],
    tol: Annotated[
        float,
        typer.Option("--tol", parser=_number, metavar="NUMBER", help="Residual to reach; it has no unit."),
    ] = 1e-9,
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind", help="Of a text file: lcp, mlcp, relay, local, global; by its name if not given."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="npz file for r (normal first) and u = W r + q.")
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Solve a contact problem from disk."""
    from rungwise.contact.read import read_problem
    from rungwise.contact.solution import Status
    from rungwise.contact.solve import solve as solve_problem

    try:
        solution = solve_problem(read_problem(file, kind), tol=tol)
    except ValueError as error:
        _refuse(str(error))
    if out is not None:
        try:
            solution.save(out)
        except OSError as error:
            _refuse(f"out: {out} cannot be written ({error.strerror or error})")
    summary = solution.summary()
    if as_json:
        _print_json({"file": str(file), **summary})
    else:
        _print(
            f"{file.name}: {solution.status}\n"
            f"  {summary['reason']}\n"
            f"  {summary['unknowns']} unknowns, {summary['contacts']} contacts;"
            f" residual {solution.residuals.worst:.1e},"
            f" {solution.iterations} iterations of {', '.join(solution.chain) or 'none'}"
        )
    return 0 if solution.status is Status.SOLVED else 1


@app.command()
def view(
    sources: Annotated[
        list[str], typer.Argument(metavar="DIR|SCENE...", help="Folders that sim --out wrote, or one scene.")
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
        typer.Option("--at", parser=_number, metavar="NUMBER", help="Time of the one frame in the PNG."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Draw saved runs, or a scene's runs on several rungs over each other; SCENE.html if no file is named."""
    from rungwise.viewing.view import ViewError
    from rungwise.viewing.view import view as draw

    folders = [Path(source) for source in sources if Path(source).is_dir()]
    runs: list[Run] = []
    if folders and (len(folders) < len(sources) or model or values):
        _refuse("view: give folders of saved runs, or one scene with --model and --set")
    if not folders:
        if len(sources) > 1:
            _refuse(f"view: {sources[1]!r} is no folder; give folders of saved runs, or one scene")
        runs = _runs(sources[0], model, values)
    try:
        written = draw(folders or runs, html=html, png=png, gif=gif, frames=frames, at=at)
    except ViewError as error:
        _refuse(str(error))
    outcomes = [{"model": run.model.name, "outcome": str(run.outcome)} for run in runs]
    if as_json:
        _print_json({"files": [str(file) for file in written], "runs": outcomes})
    else:
        _print(
            "\n".join(
                [*(f"{o['model']}: {o['outcome']}" for o in outcomes), *(f"wrote {f}" for f in written)]
            )
        )
    return 0


def _runs(source: str, models: list[str] | None, values: list[str] | None) -> list[Run]:
    """The scene's run on each of the rungs, for pictures."""
    from rungwise.models.ladder import LADDER
    from rungwise.simulation.run import simulate

    with _plain_errors():
        scene = _load(source)
        parameters = _parameters(scene, values)
        _announce_compilation()
        chosen = models or [rung.name for rung in LADDER if rung.moves]
        runs = [simulate(scene, name, parameters=parameters) for name in chosen]
    for run in runs:
        if run.outcome.name == "invalid":
            _refuse(run.reason)
    return runs


def _load(source: str) -> Scene:
    from rungwise.scene import load

    return load(source)


def _parameters(scene: Scene, values: list[str] | None) -> dict[str, float]:
    from rungwise.scene import SceneError

    given: dict[str, float] = {}
    for item in values or []:
        name, equals, text = item.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not equals or not name.strip() or value != value:
            raise SceneError(
                f"--set {item[:80]}: must be name=number; names: {', '.join(scene.file.parameters) or 'none'}"
            )
        given[name.strip()] = value
    return scene.parameters(given)


def _writable(folder: Path) -> None:
    """Refuse a folder in which nothing can be written, by trying; what this makes is removed again."""
    missing: list[Path] = []
    try:
        missing = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _refuse(f"out: {folder} cannot be written ({error.strerror or error})")
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()


def _announce_compilation(*kernel: str) -> None:
    from rungwise.kernel import is_compiled

    if not is_compiled(*kernel):
        print("rungwise: compiling kernels, once; this takes about a minute", file=sys.stderr, flush=True)


def _watch(simulation: Simulation, quiet: bool) -> bool:
    """Run to the end with a progress bar; returns whether Ctrl-C ended it."""
    silent: tuple[Callable[[], None], Callable[[], None]] = (lambda: None, lambda: None)
    report, close = silent if quiet else _bar(simulation)
    try:
        while simulation.advance():
            report()
    except KeyboardInterrupt:
        return True
    finally:
        close()
    return False


def _bar(simulation: Simulation) -> tuple[Callable[[], None], Callable[[], None]]:
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    task = bar.add_task(f"{simulation.scene.name} {simulation.model.name}", total=1.0)
    bar.start()
    return lambda: bar.update(task, completed=simulation.progress), bar.stop


def _sentence(run: Run) -> str:
    final = ", ".join(f"{b}.{c} = {x:.6g}" for b, many in run.final.items() for c, x in many.items())
    lines = [
        f"{run.scene.name} on {run.model.name}: {run.outcome}",
        f"  {run.reason}",
        f"  time {run.time:.6g} after {run.steps} steps, worst residual {run.worst_residual:.1e},"
        f" {run.wall_s:.3f} s",
        f"  {final}",
    ]
    return "\n".join(lines)
