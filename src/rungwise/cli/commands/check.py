"""`rungwise check`."""

from __future__ import annotations

from rungwise.cli.arguments import (
    JsonOption,
    SceneArgument,
    SetOption,
    SettleOption,
    load_scene,
    parameters_of,
)
from rungwise.cli.terminal import plain_errors, refuse, show, show_json


def check(
    scene: SceneArgument,
    values: SetOption = None,
    settle: SettleOption = False,
    as_json: JsonOption = False,
) -> int:
    """Validate a scene, and print its contents.

    Example: rungwise check gripper"""
    from rungwise.models.ladder import KINEMATIC
    from rungwise.planning.modes.hands import described as hands
    from rungwise.planning.task.described import described, summary
    from rungwise.planning.task.fingers import taken
    from rungwise.planning.task.task import task_of
    from rungwise.world.find import world_of
    from rungwise.world.run import simulation_of

    with plain_errors():
        loaded = load_scene(scene, settle)
        parameters = parameters_of(loaded, values)
        world = world_of(loaded)
        report = world.describe(parameters)
        is_planned = loaded.file.task is not None and loaded.file.goal is not None and loaded.file.inputs
        task = task_of(loaded, parameters) if is_planned else None
        found = None if task is None else taken(task)
        hand = None if task is None else hands.turning(task)
        start = simulation_of(loaded, KINEMATIC, parameters=parameters, frames=3).result()
    if start.outcome.name == "invalid":
        refuse(start.reason)
    notes, fingers = list(start.notes), []
    if task is not None and found is not None:
        if hand is not None:
            found = hands.without_links(task, hand, found)
            report, fingers = report | hands.summary(task, hand), hands.described(task, hand)
        report, notes, fingers = (
            report | summary(found),
            notes + list(found.notes),
            fingers + described(found),
        )
    if as_json:
        show_json(report | {"notes": notes})
    else:
        show("\n".join([world.described(report), *fingers, *notes]))
    return 0
