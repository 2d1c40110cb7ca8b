"""Matched parameters of a planar scene (see `world.matching`)."""

from __future__ import annotations

import math
from typing import Any

from rungwise.deadline import NEVER, Deadline
from rungwise.models.ladder import DYNAMIC_RIGID
from rungwise.scene import Scene, load
from rungwise.scene.fields.laws.contact import written
from rungwise.scene.template.records import Records
from rungwise.simulation.inputs import Segment
from rungwise.simulation.result import Run
from rungwise.simulation.run import Simulation
from rungwise.world.ingredients import CONDITIONS
from rungwise.world.matching import BOUNCE, DAMPING, STIFFNESS, TURN, Matched, alike, flexibility
from rungwise.world.planar.variant import GIVE, PlanarVariant
from rungwise.world.run import completed


def matched(
    scene: Scene, parameters: dict[str, float], duration: float, deadline: Deadline = NEVER
) -> Matched:
    """The scene with matched parameters: where a contact has restitution, its damping follows from that,
    otherwise its restitution follows from its damping."""
    records = PlanarVariant(scene, parameters, DYNAMIC_RIGID, 0.0).records
    names, masses = scene.template.contacts, _masses(scene, parameters, duration, deadline)
    extra: dict[str, float] = {STIFFNESS: 1.0, DAMPING: 1.0}
    contacts, notes, ratios = [], [], []
    for k, (pair, record) in enumerate(zip(names, records.contacts, strict=True)):
        give = {name: float(record[name]) for name in GIVE}
        bounce, mass, label = float(record["restitution"]), masses.get(k), "|".join(pair)
        ratio = math.nan
        if mass is not None:
            same = alike(bounce, give["damping"], give["stiffness"], mass)
            if bounce > 0.0:
                give |= dict.fromkeys(("damping", "tangential_damping"), same.damping)
            bounce, ratio = same.restitution, same.ratio
            notes.append(f"{label}: {same.told(give['stiffness'], mass)}")
        extra[BOUNCE.format(k)] = bounce
        ratios.append(ratio)
        contacts.append(_contact(pair, float(record["friction"]), k, give) | written(record))
    bodies, turning, told = _turning(scene, records)
    file = scene.file.model_dump(mode="json", exclude_unset=True)
    file.pop("task", None)
    for name in bodies:
        file["bodies"][name]["inertia"] = TURN.format(name)
        extra[TURN.format(name)] = bodies[name]
    own = file.get("parameters", {})
    file |= {"contacts": contacts, "parameters": own | {n: {"default": x} for n, x in extra.items()}}
    unmatched = ["|".join(pair) for pair, r in zip(names, ratios, strict=True) if math.isnan(r)]
    if unmatched:
        told.append(f"{', '.join(unmatched)}: no touch under the scene's own inputs, restitution as it is")
    bare = {name: value for name, value in file.items() if name not in CONDITIONS}
    return Matched(load(file), load(bare), parameters | extra, turning, (*notes, *told), tuple(ratios))


def _contact(pair: tuple[str, str], friction: float, k: int, give: dict[str, float]) -> dict[str, Any]:
    factors = {name: DAMPING if name.endswith("damping") else STIFFNESS for name in GIVE}
    numbers = {name: f"{give[name]!r} * {factors[name]}" for name in GIVE}
    return {"between": list(pair), "friction": friction, "restitution": BOUNCE.format(k), **numbers}


def _masses(
    scene: Scene, parameters: dict[str, float], duration: float, deadline: Deadline
) -> dict[int, float]:
    """The mass that each contact feels along its normal without friction, where it first closes in the rigid
    dynamic run; contacts that never do are left out."""
    found: dict[int, float] = {}
    bare = scene.changed(**dict.fromkeys(CONDITIONS))
    for k, (a, b) in enumerate(scene.template.contacts):
        until = Segment({}, duration, f"gap({a}, {b}) <= tolerance")
        run = _run(bare, deadline, parameters=parameters, inputs=[until])
        if run.steps == 0:  # closed from the start: a first step, for its terms
            run = _run(bare, deadline, parameters=parameters, duration=1e-6 * duration)
        if run.workspace is None or run.time >= duration:
            continue
        terms, state, clock = run.workspace.terms, run.workspace.state, run.workspace.state.clock[0]
        free = state.free[: int(clock["free"])]
        pairs = bare.bind(parameters).records.pairs["contact"]
        for row, slot in enumerate(run.workspace.scratch.slots[: int(clock["contacts"])]):
            if slot // 2 < len(pairs) and pairs[slot // 2] == k:
                moves = flexibility(terms, row, free)
                if moves > 0.0:
                    found.setdefault(k, 1.0 / moves)
    return found


def _run(scene: Scene, deadline: Deadline, **options: Any) -> Run:
    run: Run = completed(Simulation(scene, DYNAMIC_RIGID, frames=3, **options), deadline)
    return run


def _turning(scene: Scene, records: Records) -> tuple[dict[str, float], dict[str, float], list[str]]:
    """Bodies whose turning a support resists, with their inertia; the inertia that makes the slowest motion
    weigh it alike; and both in words."""
    bodies, turning, notes = dict[str, float](), dict[str, float](), list[str]()
    supported = {int(s["body"]): float(s["ratio"]) for s in records.supports if s["force"] > 0.0}
    for k, name in enumerate(scene.template.bodies):
        body, first = records.bodies[k], int(records.bodies[k]["coordinate"])
        ratio = supported.get(k)
        if ratio is None and scene.file.bodies[name].coordinate_names == ("x", "y", "angle"):
            drag = records.coordinates["damping"][first : first + 3]
            if scene.file.bodies[name].role == "object" and drag[0] == drag[1] > 0.0 and drag[2] > 0.0:
                ratio = math.sqrt(float(drag[2] / drag[0]))
        if ratio is not None:
            bodies[name] = float(body["inertia"])
            turning[TURN.format(name)] = float(body["mass"]) * ratio**2
            notes.append(
                f"{name}: on the kinematic rung rho^2 = I/m is {ratio**2:.3g}, the square of what its support"
                f" resists turning with over what it resists sliding with (its own I/m is"
                f" {body['inertia'] / body['mass']:.3g})"
            )
    return bodies, turning, notes
