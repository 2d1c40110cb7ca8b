"""Command line: every command prints text, or one JSON object with --json. One file for each command.

Exit codes: 0 the answer is positive, 1 it is negative or open, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import gc
import sys
from typing import Annotated, Any

import typer

from rungwise import __version__
from rungwise.cli.commands import (
    check,
    compare,
    design,
    doomed,
    export,
    fit,
    known,
    plan,
    replay,
    sets,
    sim,
    solve,
    verify,
    view,
)
from rungwise.cli.terminal import INTERRUPTED, heard_at_once, refuse, show

app = typer.Typer(
    name="rungwise",
    help="Plan grasps and pushes with six contact models, and see where they disagree.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for _command in (
    known.models, known.scenes, check.check, sim.sim, sets.sets, doomed.doomed, plan.plan, verify.verify,
    design.design, compare.compare, fit.fit, solve.solve, view.view, replay.replay,
    export.export,
):  # fmt: skip
    app.command()(_command)


@app.callback()
def _rungwise(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True)
    ] = False,
) -> None:
    """Plan manipulation with contact models of every fidelity."""


_USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""The base of click's errors, wherever this version of typer takes click from."""


RARELY = 50_000
"""New objects after which garbage is looked for: most of what a command makes at first, it keeps."""


def main() -> None:
    """Entry point: errors of use are one line and exit code 2, too."""
    gc.set_threshold(RARELY)
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    if sys.argv[1:2] == ["--version"]:
        show(f"rungwise {__version__}")
        sys.exit(0)
    try:
        with heard_at_once():
            code = app(standalone_mode=False)
    except _USAGE_ERROR as error:
        refuse(" ".join(error.format_message().split()) + _choices(error))
    except (typer.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED)
    sys.exit(code if isinstance(code, int) else 0)


def _choices(error: Any) -> str:
    """What may be given for an option or argument that is missing, or without a value."""
    option = getattr(getattr(error, "param", None), "name", None) or getattr(error, "option_name", "")
    match str(option).lstrip("-"):
        case "model":
            from rungwise.models.ladder import LADDER

            return f" Valid: {', '.join(rung.name for rung in LADDER if rung.moves)}"
        case "scene":
            from rungwise.scene import shipped

            return f" Valid: a YAML file, or {', '.join(shipped())}"
        case "over":
            return " Valid: names of parameters, separated by commas, with or without intervals (v1,mu=0:0.9)"
    return ""
