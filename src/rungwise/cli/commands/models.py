"""`rungwise models`."""

from __future__ import annotations

from rungwise.cli.arguments import JsonOption
from rungwise.cli.terminal import show, show_json


def models(as_json: JsonOption = False) -> int:
    """The ladder: six contact models, what each keeps, and its equation in the paper."""
    from dataclasses import asdict

    from rungwise.models.ladder import LADDER

    if as_json:
        show_json({"models": [asdict(rung) for rung in LADDER]})
        return 0
    show("\n".join(f"{rung.name:22s} ({rung.equation})  {rung.about}" for rung in LADDER))
    return 0
