"""Numbers that go with the causes of a diagnosis in space, read from both runs; and how runs ended.

Each pair of numbers is of the first and of the second run. Contacts are pairs of geoms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.world import ingredients
from rungwise.world.contract import OBSTACLE
from rungwise.world.find import world_of
from rungwise.world.ingredients import (
    TOUCHES,
    Motion,
    Parting,
    acting,
    evidence_of,
    of_body,
    overlaps,
    speeds,
)
from rungwise.world.spatial.variant import SLIP, SpatialVariant

MODES = ("open", "stick", "slip")
OPEN = 0
LOOKS = 200
"""Most frames of which the energy is computed."""
MOST = 3
"""Contacts that are named."""


def end(run: SpaceRun) -> dict[str, Any]:
    """How a run ended: outcome, time, and the certificate: its kind, the contacts of the last step, their
    bodies, and for a missing support the velocities that give way."""
    found: dict[str, Any] = {"outcome": str(run.outcome), "time": run.time}
    if run.certificate is None or run.space is None:
        return found
    labels, bodies = run.scene.labels, run.space.solids.body
    pairs = {(int(a), int(b)) for a, b in run.frames[-1].touch.geoms}
    found["certificate"] = {
        "kind": run.certificate.kind,
        "contacts": sorted(f"{labels.geoms[a]}|{labels.geoms[b]}" for a, b in pairs),
        "bodies": sorted({labels.bodies[int(bodies[geom])] for pair in pairs for geom in pair}),
    }
    if run.certificate.kind == "unsupported":
        motion = np.abs(run.certificate.vectors[0])
        free = np.flatnonzero(np.isnan(run.space.pace))
        at = free[: len(motion)][acting(motion)[: len(free)]]
        found["certificate"]["coordinates"] = [run.scene.template.velocities[int(k)] for k in at]
    return found


def _balance(parting: Parting) -> dict[str, Any]:
    """How fast the body is where the motions part, its weight in both worlds, and contacts that one of them
    has alone."""
    weights = [variant.loads_of(parting.body) for variant in parting.variants]
    return speeds(parting) | {"weight": weights, "alone": _alone(parting)}


def _modes(motion: Motion, times: Reals) -> dict[str, NDArray[np.int8]]:
    """Modes (m,) of each pair in the steps that hold these times."""
    values = motion.modes(times)
    return {str(pair): values[:, k] for k, pair in enumerate(motion.data.pair.values)}


def _alone(parting: Parting) -> list[list[str]]:
    """Contacts of the body that are closed where the motions part in one of them alone."""
    at = np.array([parting.time])
    closed = [
        {pair for pair, mode in _modes(motion, at).items() if mode[0] != OPEN and _has(parting, pair)}
        for motion in parting.motions
    ]
    return [sorted(closed[k] - closed[1 - k])[:MOST] for k in (0, 1)]


def _bodies(parting: Parting, pair: str) -> list[str]:
    """The bodies of a pair of geoms."""
    labels, model = parting.variants[0].scene.labels, parting.variants[0].bound.model
    return [labels.bodies[int(model.geom_bodyid[labels.geoms.index(name)])] for name in pair.split("|")]


def _has(parting: Parting, pair: str) -> bool:
    return parting.body in _bodies(parting, pair)


def _contact(parting: Parting) -> dict[str, Any]:
    """The contact whose modes differ, and since when: one of the body that is closed in both where the
    motions part, else one that is closed in one of them there, else the one that differs for longest before;
    where none does, one that was closed in both."""
    times = [motion.times[motion.times < parting.time] for motion in parting.motions]
    grid = np.append(np.unique(np.concatenate(times)), parting.time)
    one, other = (_modes(motion, grid[1:]) for motion in parting.motions)
    nothing, span = np.zeros(len(grid) - 1, np.int8), np.diff(grid)
    best: tuple[tuple[float, ...], str, Ints] = ((0.0,), "", np.zeros(0, np.int64))
    for pair in sorted({*one, *other}):
        a, b, own = one.get(pair, nothing), other.get(pair, nothing), _has(parting, pair)
        differs, closed = a != b, (a != OPEN) & (b != OPEN)
        rank: tuple[float, ...] = (
            float(own and differs[-1] and closed[-1]), float(own and differs[-1]),
            float(span @ differs) * (1.0 + own), float(span @ closed),
        )  # fmt: skip
        if rank > best[0]:
            best = rank, pair, np.flatnonzero(differs if differs.any() else closed)
    first, pair, rows = best
    if not pair:
        return {}
    # A contact that differs where the motions part is told as it is there, others as they first differ.
    breaks = np.flatnonzero(np.diff(rows) > 1)
    row = int(rows[breaks[-1] + 1] if first[1] and len(breaks) else rows[0])
    told = -1 if first[1] else row
    modes = [MODES[int(each.get(pair, nothing)[told])] for each in (one, other)]
    return {"contact": pair, "modes": modes, "since": float(grid[row]), "friction": _frictions(parting, pair)}


def _frictions(parting: Parting, pair: str) -> list[float]:
    """Friction of a contact in both worlds."""
    found = []
    for variant in parting.variants:
        model, names = variant.bound.model, variant.scene.labels.geoms
        a, b = (names.index(name) for name in pair.split("|"))
        given = float(variant.bound.laws[variant.bound.law[a, b], SLIP][0])
        own = float(max(model.geom_friction[a, 0], model.geom_friction[b, 0]))
        found.append((own if math.isnan(given) else given) if variant.model.friction else 0.0)
    return found


def _coasting(parting: Parting) -> dict[str, Any]:
    """The greatest kinetic energy of the body, and the way that it went while nothing that moves touched
    it."""
    roles = world_of(parting.variants[0].scene).roles(parting.variants[0].parameters)
    energy, coasted = [], []
    for variant, motion in zip(parting.variants, parting.motions, strict=True):
        driven = np.zeros(len(motion.times), bool)
        for pair, mode in _modes(motion, motion.times).items():
            others = [name for name in _bodies(parting, pair) if name != parting.body]
            if _has(parting, pair) and all(roles[name] != OBSTACLE for name in others):
                driven |= mode != OPEN
        own = of_body(parting)
        ways = np.linalg.norm(np.diff(motion.places[:, own], axis=0), axis=1)
        before = motion.times[1:] <= parting.time
        energy.append(_energy(variant, motion, parting.body) if variant.model.inertia > 0.0 else 0.0)
        way = float(ways[~driven[1:] & ~before].sum())
        coasts = variant.model.inertia > 0.0 and way > TOUCHES * parting.size
        coasted.append(way if coasts else 0.0)
    return {"energy": energy, "coasted": coasted}


def _energy(variant: SpatialVariant, motion: Motion, body: str) -> float:
    """The greatest kinetic energy of a body's own velocities."""
    import mujoco

    model = variant.bound.model
    data, product = mujoco.MjData(model), np.zeros(model.nv)
    names = variant.scene.template.velocities
    own = np.array([name.split(".")[0] == body for name in names])
    most, stride = 0.0, max(1, len(motion.times) // LOOKS)
    places, rates = motion.data["position"].values, motion.data["velocity"].values
    for k in range(0, len(motion.times), stride):
        data.qpos[:] = places[k]
        mujoco.mj_fwdPosition(model, data)
        v = np.where(own, rates[k], 0.0)
        mujoco.mj_mulM(model, data, product, v)
        most = max(most, 0.5 * float(v @ product))
    return most


def _bounce(parting: Parting) -> dict[str, Any]:
    """The hardest impact after which bodies parted, of either run: whose, how fast they met, and parted."""
    found: list[tuple[float, Mapping[str, Any]]] = []
    for run, motion in enumerate(parting.motions):
        gap = motion.data["gap"].values
        if len(gap) < 3:
            continue
        rate = np.diff(gap, axis=0) / np.maximum(np.diff(motion.times), 1e-300)[:, None]
        met, left = -rate[:-1], rate[1:]
        near = np.abs(gap[1:-1]) <= TOUCHES * parting.size
        hard = np.where(near, np.fmin(met, left), 0.0)
        for k, c in np.argwhere(hard > 0.0):
            told: dict[str, Any] = {
                "contact": str(motion.data.pair.values[c]), "time": float(motion.times[k + 1]), "run": run,
                "met": float(met[k, c]), "left": float(left[k, c]),
            }  # fmt: skip
            found.append((told["met"], told))
    known = [each for each in found if each[1]["time"] <= parting.time] or found
    return dict(max(known, key=lambda each: each[0])[1]) if known else {}


_OWN = {
    ingredients.BALANCE: _balance, ingredients.FRICTION: _contact, ingredients.INERTIA: _coasting,
    ingredients.RESTITUTION: _bounce, ingredients.COMPLIANCE: overlaps("pair"),
}  # fmt: skip
evidence = partial(evidence_of, _OWN)
