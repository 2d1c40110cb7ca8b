"""Numbers that go with the causes of a diagnosis, read from both runs; and how runs ended, with what proves a
jam or a missing support.

Each pair of numbers is of the first and of the second run.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import FORWARD, NAMES, OPEN
from rungwise.simulation.result import Run
from rungwise.world import ingredients
from rungwise.world.ingredients import TOUCHES, Motion, Parting, acting, evidence_of, of_body, overlaps
from rungwise.world.planar.variant import RESISTS, PlanarVariant


def end(run: Run) -> dict[str, Any]:
    """How a run ended: outcome, time, and the certificate: its kind, the contacts that press, the bodies that
    they press, and for a missing support the coordinates that give way."""
    found: dict[str, Any] = {"outcome": str(run.outcome), "time": run.time}
    if run.certificate is not None and run.workspace is not None and run.problem is not None:
        contacts = _pressing(run)
        bodies = sorted({body for contact in contacts for body in contact.split("|") if "|" in contact})
        found["certificate"] = {"kind": run.certificate.kind, "contacts": contacts, "bodies": bodies}
        if run.certificate.kind == "unsupported":
            found["certificate"]["coordinates"] = _giving(run)
    return found


def _pressing(run: Run) -> list[str]:
    """Contacts and travel limits that a certificate combines, each once."""
    assert run.certificate is not None and run.workspace is not None and run.problem is not None
    count = len(run.problem.mu)
    taking = np.zeros(count, bool)
    if run.certificate.kind == "kinematic":
        rigid = np.flatnonzero(~(run.problem.R != 0.0).any(axis=(1, 2)))
        force = run.certificate.vectors[0][: len(rigid)]
        taking[rigid] = acting(force)
    elif run.certificate.modes:
        from rungwise.contact.certify import presses  # it takes long to import

        taking = presses(run.certificate, count)
    labels = run.trajectory.point.values[run.workspace.scratch.slots[:count]]
    return sorted({_pair(str(label)) for label in labels[taking]})


def _pair(point: str) -> str:
    """The contact of a point (`rod|box/0`), or the travel limit (`left.x1/upper`)."""
    return point.split("/")[0] if "|" in point else point


def _giving(run: Run) -> list[str]:
    """Coordinates along which loads act that nothing balances."""
    assert run.certificate is not None and run.workspace is not None and run.problem is not None
    motion = np.abs(run.certificate.vectors[0])
    free = run.workspace.state.free[: len(run.problem.c)]
    at = free[: len(motion)][acting(motion)[: len(free)]]
    return [run.scene.template.coordinates[int(k)] for k in at]


def _contact(parting: Parting) -> dict[str, Any]:
    """The contact that was in different modes for longest before the motions part, and since when; or, where
    none was, one that was closed. The parted body's own count twice."""
    labels = [str(label) for label in parting.motions[0].data.point.values]
    times = [motion.times[motion.times < parting.time] for motion in parting.motions]
    grid = np.append(np.unique(np.concatenate(times)), parting.time)
    one, other = (motion.modes(grid[1:]) for motion in parting.motions)
    weights = [("|" in each) * (1.0 + (parting.body in _pair(each).split("|"))) for each in labels]
    span = np.diff(grid)[:, None] * np.array(weights)
    slick = np.array([0.0 in _frictions(parting, _pair(each)) for each in labels])
    # Without friction a contact that slides is in either sliding mode.
    differs = (one != other) & ~(slick & (np.minimum(one, other) >= FORWARD))
    if not (span * differs).any():
        differs = (one != OPEN) & (other != OPEN)
    lasting = (span * differs).sum(axis=0)
    if not lasting.any():
        return {}
    point = int(lasting.argmax())
    row = int(differs[:, point].argmax())
    return {
        "contact": _pair(labels[point]), "modes": [NAMES[int(mode[row, point])] for mode in (one, other)],
        "since": float(grid[row]), "friction": _frictions(parting, _pair(labels[point])),
    }  # fmt: skip


def _frictions(parting: Parting, label: str) -> list[float]:
    """Friction of a contact in both worlds; 1 for a travel limit, which has none to speak of."""
    names = ["|".join(pair) for pair in parting.variants[0].scene.template.contacts]
    if label not in names:
        return [1.0, 1.0]
    return [
        float(variant.records.contacts["friction"][names.index(label)]) if variant.model.friction else 0.0
        for variant in parting.variants
    ]


def _support(parting: Parting) -> dict[str, Any]:
    """What of the support of the body differs: its greatest force, its lever of torque, its centre, damping
    and dry friction."""
    found = [_resistance(variant, parting.body) for variant in parting.variants]
    return {
        name: [each.get(name, 0.0) for each in found]
        for name in dict.fromkeys([*found[0], *found[1]])
        if found[0].get(name, 0.0) != found[1].get(name, 0.0)
    }


def _resistance(variant: PlanarVariant, body: str) -> dict[str, float]:
    if not variant.model.loads:
        return {}
    records, template = variant.records, variant.scene.template
    number, found = template.bodies.index(body), dict[str, float]()
    for support in records.supports[records.supports["body"] == number]:
        for name, field in (("force", "force"), ("lever", "ratio"), ("x", "centre_x"), ("y", "centre_y")):
            found[name] = float(support[field])
    for name, coordinate in zip(template.coordinates, records.coordinates, strict=True):
        if name.split(".")[0] == body:
            found |= {f"{field} of {name}": float(coordinate[field]) for field in RESISTS}
    return found


def _coasting(parting: Parting) -> dict[str, Any]:
    """The greatest kinetic energy of the body, and the way that it went while nothing that moves touched
    it."""
    energies, ways = [], []
    for variant, motion in zip(parting.variants, parting.motions, strict=True):
        own, data = of_body(parting), motion.data
        mass = variant.records.coordinates["mass"] * variant.model.inertia
        energy = 0.5 * (data["velocity"].values[:, own] ** 2 * mass[own]).sum(axis=1)
        alone = ~_is_driven(parting, motion)
        ways.append(float(np.linalg.norm(np.diff(motion.places[:, own], axis=0), axis=1)[alone[1:]].sum()))
        energies.append(float(energy.max(initial=0.0)))
    return {"energy": energies, "coasted": ways}


def _is_driven(parting: Parting, motion: Motion) -> NDArray[np.bool_]:
    """For each frame (k,) whether a robot or an object touches the body."""
    data, bodies = motion.data, parting.variants[0].scene.file.bodies
    columns = []
    for k, label in enumerate(data.point.values):
        pair = _pair(str(label)).split("|")
        others = [name for name in pair if name != parting.body]
        if parting.body in pair and all(bodies[name].role != "obstacle" for name in others):
            columns.append(k)
    return np.asarray((data["mode"].values[:, columns] != OPEN).any(axis=1))


def _bounce(parting: Parting) -> dict[str, Any]:
    """The hardest impact after which bodies parted, of either run and before the motions part, if there is
    one: whose, how fast they met, and parted. Bodies that touch from the start have no speed at which they
    met."""
    contacts = [str(name) for name in parting.motions[0].data.contact.values]
    found = []
    for run, motion in enumerate(parting.motions):
        gap = motion.data["gap"].values
        if len(gap) < 4:
            continue
        speed = np.diff(gap, axis=0) / np.maximum(np.diff(motion.times), 1e-300)[:, None]
        near = np.abs(gap) <= TOUCHES * parting.size
        # The step of an impact may begin with the approach: the step before it is as fast or faster.
        met, left = np.maximum(-speed[:-2], -speed[1:-1]), speed[2:]
        hard = np.where(near[2:-1], np.minimum(met, left), 0.0)
        hits = [(int(k) + 2, int(c), float(met[k, c])) for k, c in np.argwhere(hard > 0.0)]
        hits += [(0, int(c), 0.0) for c in np.flatnonzero(near[0] & (speed[0] > 0.0))]
        found += [(float(motion.times[k]), run, c, hit, float(speed[k, c])) for k, c, hit in hits]
    if not found:
        return {}
    known = [each for each in found if each[0] <= parting.time] or found
    time, run, contact, hit, rebound = max(known, key=lambda each: each[4])
    speeds = {"met": hit} if hit else {}
    return {"contact": contacts[contact], "time": time, "run": run, **speeds, "left": rebound}


_OWN = {
    ingredients.FRICTION: _contact, ingredients.SUPPORT: _support, ingredients.INERTIA: _coasting,
    ingredients.RESTITUTION: _bounce, ingredients.COMPLIANCE: overlaps("contact"),
}  # fmt: skip
evidence = partial(evidence_of, _OWN)
