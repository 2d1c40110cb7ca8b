"""`rungwise models` and `rungwise scenes`: what there is."""

from __future__ import annotations

from typing import Annotated

import typer

from rungwise.cli.arguments import JsonOption
from rungwise.cli.terminal import show, show_json


def models(as_json: JsonOption = False) -> int:
    """List the six contact models with their equations."""
    from dataclasses import asdict

    from rungwise.models.ladder import LADDER

    if as_json:
        show_json({"models": [asdict(rung) for rung in LADDER]})
        return 0
    show("\n".join(f"{rung.name:22s} ({rung.equation})  {rung.about}" for rung in LADDER))
    return 0


def scenes(
    as_json: JsonOption = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of scene files.")] = False,
) -> int:
    """List the scenes that ship."""
    from rungwise.scene import load, shipped
    from rungwise.scene import schema as scene_schema
    from rungwise.scene.space.read import file_of, shipped_in_space

    if schema:
        show_json(scene_schema(), indent=None if as_json else 1)
        return 0
    known = {name: load(name).file.about for name in shipped()}
    known |= {name: file_of(name).about for name in shipped_in_space()}
    if as_json:
        show_json({"scenes": known})
        return 0
    show("\n".join(f"{name:22s} {about}" for name, about in known.items()))
    return 0
