"""Taking a run to its end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def finished(simulation: Any, on_progress: Callable[[Any], None] | None = None) -> Any:
    """The result of a run that is taken in turns, after its last; `on_progress` is called after each other
    turn."""
    while simulation.advance():
        if on_progress is not None:
            on_progress(simulation)
    return simulation.result()
