"""Bars that tell how far long work has come; none with --json, or where no terminal shows them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rungwise.deadline import Deadline
    from rungwise.simulation.run import Simulation
    from rungwise.simulation.spatial.run import SpaceSimulation


def watch(simulation: Simulation | SpaceSimulation, deadline: Deadline, as_json: bool) -> bool:
    """Run to the end, or to the deadline, with a progress bar; returns whether Ctrl-C ended it."""
    from rungwise.world.run import finished

    try:
        with bar(f"{simulation.scene.name} {simulation.model.name}", 1.0, as_json) as report:
            finished(simulation, None if report is None else lambda run: report(run.progress), deadline)
    except KeyboardInterrupt:
        return True
    return False


@contextmanager
def counting(name: str, as_json: bool) -> Iterator[Callable[[str, int, int], None] | None]:
    """A bar of runs done over runs known to be needed, with the time left; they grow with each level."""
    if _is_quiet(as_json):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(name, total=None)
        yield lambda what, done, known: shown.update(
            task, description=f"{name}: {what}", completed=done, total=known
        )


@contextmanager
def line(as_json: bool) -> Iterator[Callable[[str], None] | None]:
    """One line on what is done now, which the next one replaces."""
    if _is_quiet(as_json):
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as shown:
        yield lambda text: shown.update(text)


@contextmanager
def bar(name: str, total: float, as_json: bool) -> Iterator[Callable[[float], None] | None]:
    """A bar of what is done over all that there is to do."""
    if _is_quiet(as_json):
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(name, total=total)
        yield lambda done: shown.update(task, completed=done)


def _is_quiet(as_json: bool) -> bool:
    return as_json or not sys.stderr.isatty()
