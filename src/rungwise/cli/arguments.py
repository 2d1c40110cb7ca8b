"""Arguments that several commands take, and their meanings."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rungwise.cli.terminal import refuse

if TYPE_CHECKING:
    from rungwise.planning.plan import Plan
    from rungwise.scene.contract import AnyScene


def numeric(name: str, about: str, metavar: str = "NUMBER") -> Any:
    """An option whose value is a number."""
    return typer.Option(name, parser=number, metavar=metavar, help=about)


def path(name: str, about: str) -> Any:
    """An option whose value is a file or a folder."""
    return typer.Option(name, help=about)


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"must be a number, not {str(text)[:60]!r}") from None


def scenes(incomplete: str) -> list[str]:
    """Names of scenes that ship, for shells that complete words."""
    from rungwise.scene.scene import shipped
    from rungwise.scene.space.read import shipped_in_space

    return [name for name in (*shipped(), *shipped_in_space()) if name.startswith(incomplete)]


def rungs(incomplete: str) -> list[str]:
    """Names of rungs, for shells that complete words."""
    from rungwise.models.ladder import LADDER

    return [rung.name for rung in LADDER if rung.name.startswith(incomplete)]


def parameters(context: typer.Context, incomplete: str) -> list[str]:
    """Names of the scene's parameters, for shells that complete words: the last of several."""
    before, comma, name = incomplete.rpartition(",")
    # An option that still lacks its value ends parsing, and leaves positional words in `args`.
    given = context.params.get("scene") or next(iter(context.params.get("sources") or context.args), "")
    try:
        known = load_scene(str(given)).file.parameters
    except (ValueError, OSError):
        return []
    return [f"{before}{comma}{each}" for each in known if each.startswith(name)]


def rung(about: str, name: str = "--model") -> Any:
    """An option whose value is the name of a rung."""
    return typer.Option(name, autocompletion=rungs, help=about)


SceneArgument = Annotated[
    str,
    typer.Argument(
        help="Name of a scene that ships, or path of a YAML, MJCF or URDF file.", autocompletion=scenes
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", help="Value of a parameter, name=value; may be repeated.", autocompletion=parameters
    ),
]
OverOption = Annotated[
    str,
    typer.Option(
        "--over",
        autocompletion=parameters,
        help="Parameters to vary: NAME or NAME=LOW:HIGH, separated by commas.",
    ),
]
SettleOption = Annotated[
    bool,
    typer.Option(
        "--settle", help="In space: move the start to the nearest one without overlap, with joints in range."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]

ThreadsOption = Annotated[
    int | None, typer.Option("--threads", min=1, help="Number of threads; all cores if not given.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="Dask scheduler whose workers do the runs."),
]
LimitOption = Annotated[
    float | None,
    numeric("--limit", "End after this time, print the results so far and the work left undone.", "SECONDS"),
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Overwrite files that exist, and the folder of --out.")
]
ResumeOption = Annotated[bool, typer.Option("--resume", help="Continue from the batches kept in --out.")]
TimeOption = Annotated[float | None, numeric("--time", "End of the run; the scene's own if not given.")]
TolOption = Annotated[float | None, numeric("--tol", "Error allowed per step: step lengths are chosen.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Seed of the random draws.")]


def load_scene(source: str, settle: bool = False) -> AnyScene:
    """A scene of either kind."""
    from rungwise.scene.read import load

    return load(source, settle=settle)


def parameters_of(scene: AnyScene, values: list[str] | None) -> dict[str, float]:
    """All parameters of the scene, with the values given by --set."""
    return scene.parameters(given_values(scene, values))


def load_with(source: str, values: list[str] | None, settle: bool) -> tuple[AnyScene, dict[str, float]]:
    """A scene, and all its parameters with the values given by --set."""
    scene = load_scene(source, settle)
    return scene, parameters_of(scene, values)


def given_values(scene: AnyScene, values: list[str] | None) -> dict[str, float]:
    """The values given by --set."""
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
    return given


def intervals(option: str, text: str) -> tuple[list[str], dict[str, tuple[float, float]]]:
    """Names, and the intervals that are given, of NAME or NAME=LOW:HIGH, separated by commas."""
    names, box = [], {}
    for item in text.split(","):
        name, equals, interval = (part.strip() for part in item.partition("="))
        names.append(name)
        if equals:
            low, _, high = interval.partition(":")
            try:
                box[name] = float(low), float(high)
            except ValueError:
                refuse(f"{option}: {item[:60]!r} must be NAME or NAME=LOW:HIGH")
    return names, box


def writable(folder: Path) -> None:
    """Refuse a folder in which nothing can be written, by trying; folders made by the trial are removed
    again."""
    missing: list[Path] = []
    try:
        missing = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        refuse(f"out: {folder} cannot be written ({error.strerror or error})")
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()


def writable_file(file: Path) -> None:
    """Refuse a file that cannot be written, by trying in its folder."""
    if file.is_dir():
        refuse(f"out: {file} is a folder, not a file")
    writable(file.parent)
    file.parent.mkdir(parents=True, exist_ok=True)


def unused(out: Path | None, force: bool, resume: bool | None = None, option: str = "out") -> None:
    """Refuse a file that exists, or a folder in which something is, unless it may be overwritten, or the
    command is to `resume` what is there; None where it cannot. A folder to resume must hold a request, unless
    it is empty. Batches that are overwritten are removed. The line begins with the option."""
    if out is None:
        return
    with suppress(OSError):
        if (
            resume
            and any(out.iterdir())
            and not any(out.glob("request.json")) | any(out.glob("*/request.json"))
        ):
            refuse(f"resume: {out} holds nothing to go on from; give another folder, or --force instead")
        if not resume and not force and out.exists() and (not out.is_dir() or any(out.iterdir())):
            goes_on = "" if resume is None else ", --resume goes on from it"
            refuse(f"{option}: {out} exists; --force overwrites it{goes_on}")
    if force and resume is False:
        from rungwise.stored import remove

        for request in out.rglob("request.json"):
            for name in ("batches", "set.zarr", request.name):
                remove(request.with_name(name))


def unused_files(force: bool, **files: Path | None) -> None:
    """Refuse files that exist unless they may be overwritten; by the options that name them."""
    for option, file in files.items():
        unused(file, force, option=option)


def load_plan_file(file: Path) -> Plan:
    """A saved plan; refused in one line where there is none."""
    from rungwise.planning.plan import load_plan

    try:
        return load_plan(file)
    except FileNotFoundError:
        refuse(f"plan: {str(file)[:200]!r} is no file")
