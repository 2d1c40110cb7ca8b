"""Bars that tell how far long work has come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rungwise.simulation.run import Simulation
    from rungwise.simulation.spatial.run import SpaceSimulation


def watch(simulation: Simulation | SpaceSimulation, quiet: bool) -> bool:
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


def _bar(simulation: Simulation | SpaceSimulation) -> tuple[Callable[[], None], Callable[[], None]]:
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    task = bar.add_task(f"{simulation.scene.name} {simulation.model.name}", total=1.0)
    bar.start()
    return lambda: bar.update(task, completed=simulation.progress), bar.stop


@contextmanager
def counting(name: str, quiet: bool) -> Iterator[Callable[[str, int, int], None] | None]:
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


@contextmanager
def line(quiet: bool) -> Iterator[Callable[[str], None] | None]:
    """One line on what is done now, which the next one replaces."""
    if quiet:
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as shown:
        yield lambda text: shown.update(text)


@contextmanager
def bar(name: str, total: int, quiet: bool) -> Iterator[Callable[[int], None] | None]:
    """A bar of runs done over a number of runs that is known."""
    if quiet:
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(name, total=total)
        yield lambda done: shown.update(task, completed=done)
