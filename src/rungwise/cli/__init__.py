"""Command line: every command prints text, or one JSON object with --json. One file for each command.

Exit codes: 0 the answer is positive, 1 it is negative, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import sys
from typing import Any

import typer

from rungwise.cli import check, doomed, models, scenes, sets, sim, solve, view
from rungwise.cli.terminal import INTERRUPTED, refuse

app = typer.Typer(
    name="rungwise",
    help="Plan manipulation with contact models of every fidelity.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for _command in (
    models.models, scenes.scenes, check.check, sim.sim, sets.sets, doomed.doomed, solve.solve, view.view,
):  # fmt: skip
    app.command()(_command)
_USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""The base of click's errors, wherever this version of typer takes click from."""


def main() -> None:
    """Entry point: errors of use are one line and exit code 2, too."""
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    try:
        code = app(standalone_mode=False)
    except _USAGE_ERROR as error:
        refuse(" ".join(error.format_message().split()))
    except (typer.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED)
    sys.exit(code if isinstance(code, int) else 0)
