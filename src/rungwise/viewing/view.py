"""Runs to files: the choice of pictures, of runs and of places."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from rungwise.errors import InputError
from rungwise.keywords import keywords
from rungwise.scene import SceneError
from rungwise.sets.feasible import FeasibleSet, load_set
from rungwise.sets.store import STORE, SetError
from rungwise.simulation.result import Run
from rungwise.viewing import draw, sets
from rungwise.viewing.clip import Clip, clip
from rungwise.viewing.html import page

Source = Run | FeasibleSet | str | Path


class ViewError(InputError):
    """A picture cannot be made; the text is one line that says why."""


@keywords
def view(
    runs: Source | Sequence[Source],
    *,
    html: str | Path | None = None,
    png: str | Path | None = None,
    gif: str | Path | None = None,
    frames: int = 6,
    at: float | None = None,
) -> list[Path]:
    """Write pictures of a run, or of several runs over each other, or of sets; returns the files written.

    Args:
        runs: runs, or folders that `Run.save` wrote; or, for html only, sets of one scene over the
            same box, or folders that `FeasibleSet.save` wrote.
        html: an animation in one file that any browser plays, without a network.
        png: a strip of `frames` pictures, or the one at time `at` (needs the extra `view`).
        gif: a short animation (needs the extra `view`).

    Raises ViewError when the runs show different bodies, a folder holds no run, an extra is missing or a file
    cannot be written. Without html, png and gif the animation goes to `SCENE.html`.
    """
    sources = [_source(one) for one in ([runs] if isinstance(runs, Source) else runs)]
    if not sources:
        raise ViewError("runs: at least one is needed")
    if frames < 1:
        raise ViewError(f"frames: {frames!r} must be at least 1")
    found = [source for source in sources if isinstance(source, FeasibleSet)]
    if found:
        if len(found) < len(sources) or png is not None or gif is not None:
            raise ViewError("view: sets and runs go to files of their own, and sets to html only")
        return [_sets(found, html)]
    try:
        clips = [clip(source) for source in sources if not isinstance(source, FeasibleSet)]
    except SceneError as error:
        raise ViewError(str(error)) from None
    _same_bodies(clips)
    if html is None and png is None and gif is None:
        html = f"{clips[0].scene}.html"
    made: list[tuple[str, str | Path, Callable[[Path], object]]] = []
    if html is not None:
        text = page(clips)
        made.append(("html", html, lambda file: file.write_text(text, "utf-8")))
    if png is not None:
        needs_matplotlib("png")
        made.append(("png", png, lambda file: draw.save_png(clips, file, frames, at)))
    if gif is not None:
        needs_matplotlib("gif")
        made.append(("gif", gif, lambda file: draw.save_gif(clips, file)))
    return [write(*one) for one in made]


def _source(source: Source) -> Source:
    """The set in a folder of a set; any other source as it is."""
    if isinstance(source, str | Path) and (Path(source) / STORE).is_dir():
        try:
            return load_set(source)
        except (SceneError, SetError, OSError) as error:
            raise ViewError(f"view: {error}") from None
    return source


def _sets(found: Sequence[FeasibleSet], html: str | Path | None) -> Path:
    first = found[0]
    for other in found[1:]:
        if (other.scene.file, other.over, other.box.tolist()) != (
            first.scene.file, first.over, first.box.tolist()
        ):  # fmt: skip
            raise ViewError("view: the sets must be of one scene, over the same parameters and box")
    text = sets.page(found)
    target = f"{first.scene.name}_sets.html" if html is None else html
    return write("html", target, lambda file: file.write_text(text, "utf-8"))


def _same_bodies(clips: Sequence[Clip]) -> None:
    for other in clips[1:]:
        if (other.bodies, other.contacts) != (clips[0].bodies, clips[0].contacts):
            raise ViewError(
                f"runs: {clips[0].scene} and {other.scene} do not have the same bodies; view them one by one"
            )


def needs_matplotlib(field: str) -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ViewError(f"{field}: needs matplotlib (pip install 'rungwise[view]')") from None


def write(field: str, target: str | Path, make: Callable[[Path], object]) -> Path:
    """Make the file beside its place and rename it there: it is whole or not there."""
    file = Path(target)
    draft = file.with_name(f".{file.name}.{uuid.uuid4().hex[:8]}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        make(draft)
        os.replace(draft, file)
    except OSError as error:
        raise ViewError(f"{field}: {file} cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
    return file
