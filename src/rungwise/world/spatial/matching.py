"""Matched parameters in space: restitution and damping of each pair of geoms that touch.

See `matching`. Entries for these pairs come before the scene's own, whose stiffness and damping have the
factors of the paths as well. The kinematic rung keeps each body's own rho^2 = I/m.
"""

from __future__ import annotations

import json
from typing import Any

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import DYNAMIC_RIGID
from rungwise.outcome import Code
from rungwise.scene.fields.laws.contact import written
from rungwise.scene.space import SpaceBound, SpaceScene, load_space
from rungwise.scene.space.fields import ENTRIES
from rungwise.scene.space.laws import FROM
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.world.ingredients import CONDITIONS
from rungwise.world.matching import BOUNCE, DAMPING, STIFFNESS, Matched, alike, flexibility

FIELDS = ("stiffness", "tangential_stiffness", "damping", "tangential_damping")
"""What the first columns of a scene's laws are."""
STEPS = 8000
"""Most steps of the run that finds who touches: as many as a planar comparison allows a run."""
KEPT = "rho^2 = I/m of the kinematic rung stays each body's own in space"

Pair = tuple[int, int]


def matched(
    scene: SpaceScene, parameters: dict[str, float], duration: float, deadline: Deadline = NEVER
) -> Matched:
    """The scene with matched parameters: where a contact has restitution, its damping follows from that,
    otherwise its restitution follows from its damping."""
    bound, file = scene.bind(parameters), json.loads(scene.stored)
    file.pop("task", None)
    bare = {name: value for name, value in file.items() if name not in CONDITIONS}
    masses = _masses(load_space(bare), parameters, duration, deadline)
    extra: dict[str, float] = {STIFFNESS: 1.0, DAMPING: 1.0}
    entries, ratios, told = list[dict[str, Any]](), list[float](), dict[str, list[str]]()
    names, room = scene.labels.geoms, ENTRIES - len(scene.file.contacts) - 1
    left = []
    for (a, b), mass in masses.items():
        label = f"{names[a]}|{names[b]}"
        if len(entries) >= room or not (_is_one(scene, bound, a) and _is_one(scene, bound, b)):
            left.append(label)
            continue
        number = int(bound.law[a, b])
        row = bound.laws[number].copy()
        same = alike(float(row[4]), float(row[2]), row[0], mass)
        if row[4] > 0.0:
            row[2:4] = same.damping
        extra[BOUNCE.format(len(entries))] = same.restitution
        entry = _entry((names[a], names[b]), row, _frictions(scene, number) | written(bound.named[number]))
        entries.append(entry | {"restitution": BOUNCE.format(len(entries))})
        ratios.append(same.ratio)
        told.setdefault(same.told(row[0], mass), []).append(label)
    notes = [f"{', '.join(pairs)}: {words}" for words, pairs in told.items()]
    if left:
        notes.append(f"{', '.join(left)}: not matched, too many pairs or names that others have")
    if not masses:
        notes.append("no pair of geoms touches under the scene's own inputs, restitution as it is")
    for number, own in enumerate(scene.file.contacts, 1):
        fields = _frictions(scene, number) | written(bound.named[number])
        scaled = _entry(own.between, bound.laws[number], fields)
        entries.append(scaled | {"restitution": own.restitution})
    entries.append(_entry(("*", "*"), bound.laws[0], {}))
    given = {"parameters": file.get("parameters", {}) | {n: {"default": x} for n, x in extra.items()}}
    given["contacts"] = entries
    whole, without = load_space(file | given), load_space(bare | given)
    return Matched(whole, without, parameters | extra, {}, (*notes, KEPT), tuple(ratios))


def _entry(between: tuple[str, str], row: Reals, frictions: dict[str, float | str]) -> dict[str, Any]:
    factors = (STIFFNESS, STIFFNESS, DAMPING, DAMPING)
    numbers = {
        name: f"{float(x)!r} * {factor}" for name, x, factor in zip(FIELDS, row, factors, strict=False)
    }
    return {"between": list(between), **numbers, **frictions}


def _frictions(scene: SpaceScene, number: int) -> dict[str, float | str]:
    """Friction of a law as far as it is written; the rest is the model's."""
    if not number:
        return {}
    entry = scene.file.contacts[number - 1]
    given = {name: getattr(entry, name) for name in ("friction", *FROM)}
    return {name: value for name, value in given.items() if value is not None}


def _is_one(scene: SpaceScene, bound: SpaceBound, geom: int) -> bool:
    """Whether the label of a geom names this one alone."""
    name, labels, model = scene.labels.geoms[geom], scene.labels, bound.model
    of_body = {labels.bodies[b] for b in model.geom_bodyid} | {model.body(b).name for b in model.geom_bodyid}
    if name in of_body:
        b = labels.bodies.index(name) if name in labels.bodies else -1
        return b == int(model.geom_bodyid[geom]) and int(model.body_geomnum[b]) == 1
    return [model.geom(g).name for g in range(model.ngeom)].count(name) <= 1


def _masses(
    scene: SpaceScene, parameters: dict[str, float], duration: float, deadline: Deadline
) -> dict[Pair, float]:
    """The mass that each pair of geoms feels along the normal of a contact, without friction, where it first
    pushes in the rigid dynamic run, in the order of these touches."""
    found: dict[Pair, float] = {}
    simulation = SpaceSimulation(
        scene, DYNAMIC_RIGID, parameters=parameters, duration=duration, frames=3
    )  # fmt: skip
    stepper = simulation.stepper
    if stepper is None:
        return found
    simulation.deadline = deadline
    while simulation.outcome == Code.RUNNING and simulation.steps < STEPS:
        deadline.look()
        simulation.steps_taken(1)
        d, terms = simulation.space.size.directions, stepper.terms
        for k, slot in enumerate(stepper.scratch.slots[: stepper.contacts]):
            if slot >= simulation.space.most or not stepper.scratch.contact_force[k * d] > 0.0:
                continue
            a, b = (int(g) for g in simulation.space.kept.geoms[slot])
            if a < 0 or (a, b) in found:
                continue
            free = stepper.state.free[: int(stepper.clock["free"])]
            moves = flexibility(terms, k, free)
            if moves > 0.0:
                found[a, b] = 1.0 / moves
    return found
