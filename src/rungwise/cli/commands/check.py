"""`rungwise check`."""

from __future__ import annotations

from rungwise.cli.arguments import JsonOption, SceneArgument, SetOption, load_scene, parameters_of
from rungwise.cli.terminal import plain_errors, refuse, show, show_json


def check(scene: SceneArgument, values: SetOption = None, as_json: JsonOption = False) -> int:
    """Validate a scene; print its bodies, coordinates, contacts and parameters."""
    from rungwise.models.ladder import KINEMATIC
    from rungwise.world.find import world_of
    from rungwise.world.run import simulation_of

    with plain_errors():
        loaded = load_scene(scene)
        parameters = parameters_of(loaded, values)
        world = world_of(loaded)
        report = world.describe(parameters)
        start = simulation_of(loaded, KINEMATIC, parameters=parameters, frames=3).result()
    if start.outcome.name == "invalid":
        refuse(start.reason)
    if as_json:
        show_json(report | {"notes": list(start.notes)})
    else:
        show("\n".join([world.described(report), *start.notes]))
    return 0
