"""Runs to files: the choice of pictures, of runs and of places."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rungwise.deadline import Deadline, seconds
from rungwise.errors import InputError
from rungwise.keywords import keywords
from rungwise.planning.plan import Plan, load_plan
from rungwise.scene import SceneError
from rungwise.scene.fields.values import shown
from rungwise.sets.feasible.feasible import FeasibleSet, load_set
from rungwise.sets.store import STORE
from rungwise.simulation import trajectory
from rungwise.simulation.any_run import AnyRun
from rungwise.viewing.drawers import Drawer, drawer_of, drawer_of_saved
from rungwise.viewing.sets import sets_page as sets
from rungwise.viewing.sets import slices
from rungwise.viewing.skeleton import LARGEST
from rungwise.viewing.write import ViewError, needs_matplotlib, write
from rungwise.wording import listed

Source = AnyRun | Plan | FeasibleSet | str | Path


@keywords
def view(
    runs: Source | Sequence[Source],
    *,
    html: str | Path | None = None,
    png: str | Path | None = None,
    gif: str | Path | None = None,
    frames: int = 6,
    at: float | None = None,
    limit: float | None = None,
    overwrite: bool = True,
) -> list[Path]:
    """Write pictures of a run or a plan, or of several runs beside each other, or of sets; returns the files
    written.

    Args:
        runs: runs or plans, or where `Run.save` and `Plan.save` wrote them; or sets of one scene over the
            same box, or folders that `FeasibleSet.save` wrote.
        html: an animation in one file that any browser plays, without a network; of sets, surfaces,
            slices and runs.
        png: a strip of `frames` pictures, or the one at time `at`; of sets, slices, and where they
            differ (needs the extra `view`).
        gif: a short animation (needs the extra `view`); not of sets.
        limit: seconds for the runs that the pictures need. An unfinished run of a plan is shown so far,
            and called `running`; pages of sets show fewer runs.
        overwrite: whether files that exist are overwritten; otherwise they are refused.

    Raises ViewError when the runs show different bodies, a folder holds no run, an extra is missing, or
    a file cannot be written or may not be overwritten. Without html, png and gif the animation goes to
    `SCENE.html`.
    """
    listed_runs, deadline = _listed(runs), Deadline(seconds(limit))
    sources = [_source(one, deadline.share(len(listed_runs) - k)) for k, one in enumerate(listed_runs)]
    if not sources:
        raise ViewError("runs: at least one is needed")
    if frames < 1:
        raise ViewError(f"frames: {frames!r} must be at least 1")
    if at is not None and not (isinstance(at, int | float) and 0.0 <= at < math.inf):
        raise ViewError(f"at: must be a finite time, at least 0, not {shown(at)}")
    found = [source for source in sources if isinstance(source, FeasibleSet)]
    if found:
        if len(found) < len(sources) or gif is not None:
            raise ViewError("view: sets and runs go to files of their own, and sets to html and png only")
        return _sets(found, html, png, deadline, overwrite)
    try:
        drawer = _drawer(sources)
    except SceneError as error:
        raise ViewError(f"view: {error}") from None
    if (png is not None and drawer.strip is None) or (gif is not None and drawer.gif is None):
        raise ViewError(f"view: {drawer.runs} go to html only")
    try:
        clips = [drawer.clip(source) for source in sources]
        drawer.alike(clips)
    except InputError as error:
        raise ViewError(str(error)) from None
    if html is None and png is None and gif is None:
        html = f"{drawer.name(clips[0])}.html"
    _may_write(overwrite, html=html, png=png, gif=gif)
    made: list[tuple[str, str | Path, Callable[[Path], object]]] = []
    if html is not None:
        text = drawer.page(clips, LARGEST)
        made.append(("html", html, lambda file: file.write_text(text, "utf-8")))
    if png is not None and (strip := drawer.strip) is not None:
        needs_matplotlib("png")
        made.append(("png", png, lambda file: strip(clips, frames, at).savefig(file, format="png")))
    if gif is not None and (to_gif := drawer.gif) is not None:
        needs_matplotlib("gif")
        made.append(("gif", gif, lambda file: to_gif(clips, file)))
    return [write(*one) for one in made]


def _may_write(overwrite: bool, **files: str | Path | None) -> None:
    """Raise ViewError for a file that exists and may not be overwritten."""
    for field, file in files.items():
        if file is not None and not overwrite and Path(file).exists():
            raise ViewError(f"{field}: {file} exists; --force (overwrite=True) overwrites it")


def _drawer(sources: Sequence[Any]) -> Drawer:
    """What draws all of them."""
    drawers = [drawer_of_saved(one) if isinstance(one, Path) else drawer_of(one.scene) for one in sources]
    if any(other is not drawers[0] for other in drawers):
        kinds = dict.fromkeys(drawer.runs for drawer in drawers)
        raise ViewError(f"runs: {' and '.join(kinds)} go to pages of their own")
    return drawers[0]


def _is_source(source: object) -> bool:
    return isinstance(source, Plan | FeasibleSet | str | Path) or hasattr(type(source), "trajectory")


def _listed(runs: object) -> list[object]:
    if _is_source(runs):
        return [runs]
    if isinstance(runs, Sequence):
        return list(runs)
    raise ViewError(f"runs: must be runs, plans, sets or where they are saved, not {shown(runs)}")


def _source(source: object, limit: float | None) -> Any:
    """The set in a folder of a set, the run of a plan; a run, or the folder of one, as it is."""
    if not _is_source(source):
        raise ViewError(f"runs: must be runs, plans, sets or where they are saved, not {shown(source)}")
    try:
        if isinstance(source, str | Path):
            path = Path(source)
            if (path / STORE).is_dir():
                return load_set(path)
            if path.suffix != ".json" or path.is_dir():
                _point(path)
                return path
            source = load_plan(path)
        if isinstance(source, Plan):
            if not source.found:
                raise ViewError(f"plan: there is none. {source.reason}")
            return source.replay(limit=limit)
        return source
    except ViewError:
        raise
    except (InputError, OSError) as error:
        raise ViewError(f"view: {error}") from None


def _point(folder: Path) -> None:
    """Where a folder holds no result, but folders in it do: a line that names those. Raises ViewError."""
    if not folder.is_dir() or (folder / trajectory.SUMMARY).exists():
        return
    within = [
        str(each)
        for each in sorted(folder.iterdir())
        if (each / STORE).is_dir() or (each / trajectory.SUMMARY).is_file()
    ]
    if within:
        raise ViewError(f"view: {folder} holds no result itself; these folders in it do: {listed(within)}")


def _sets(
    found: Sequence[FeasibleSet],
    html: str | Path | None,
    png: str | Path | None,
    deadline: Deadline,
    overwrite: bool,
) -> list[Path]:
    first = found[0]
    for other in found[1:]:
        if (other.scene.file, other.over, other.box.tolist()) != (
            first.scene.file, first.over, first.box.tolist()
        ):  # fmt: skip
            raise ViewError("view: the sets must be of one scene, over the same parameters and box")
    files = []
    if html is None and png is None:
        html = f"{first.scene.name}_sets.html"
    _may_write(overwrite, html=html, png=png)
    if html is not None:
        text = sets.page(found, deadline)
        files.append(write("html", html, lambda file: file.write_text(text, "utf-8")))
    if png is not None:
        needs_matplotlib("png")
        drawing = slices.feasible_slices(found)
        files.append(write("png", png, lambda file: drawing.savefig(file, format="png", dpi=120)))
    return files
