"""A start that is settled: places of the model, what is built into each other, and what was moved, in words.

Bodies that a model builds into each other, as many hands do, overlap wherever their joints stand. Two that
still overlap, and that at most three joints part, are taken as such: they do not touch. What motion capture
leads is put where the body is that an equality holds to it.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.scene import InvalidScene
from rungwise.scene.space.labels import Labels
from rungwise.scene.space.settle import MOST, Settled, settle

if TYPE_CHECKING:
    import mujoco

KIN = 3
"""Joints from body to body, along the tree, that may part what is built into each other."""
TURNS = 8
"""Times that settling is repeated because bodies proved to be built into each other."""
NAMED = 3
"""Coordinates, and pairs of bodies, that a remark names."""
LEFT = 1e-5
"""Overlap over the size of what moves from which on a start is refused here; less is for the run to judge."""


class Start(NamedTuple):
    """A model, places (n_q,) that it allows, and remarks on how they differ from what was given."""

    model: mujoco.MjModel
    place: Reals
    notes: tuple[str, ...]


def settled(spec: mujoco.MjSpec, model: mujoco.MjModel, names: Labels, place: Reals, fused: bool) -> Start:
    """The allowed start nearest to `place` (n_q,). `fused`: links that do not move are part of the world, as
    in URDF. Raises InvalidScene where there is none near."""
    found, built = settle(model, place), list[tuple[int, int]]()
    for _ in range(TURNS):
        pairs = [pair for pair in found.pairs if _is_kin(model, *pair, fused)]
        if not pairs:
            break
        built += pairs
        for one, other in pairs:
            spec.add_exclude(bodyname1=model.body(one).name, bodyname2=model.body(other).name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = spec.compile()
        found = settle(model, place)
    _check(found, names)
    _lead_along(model, place, found.q)
    return Start(model, found.q, (*_of_pairs(built, names), *_of_motion(names, place, found)))


def _is_kin(model: mujoco.MjModel, one: int, other: int, fused: bool) -> bool:
    """Whether at most `KIN` joints and equalities part two bodies; through the world only where it is a
    link."""
    if not (model.body(one).name and model.body(other).name):
        return False
    steps, reached = {one: 0}, [one]
    near = _neighbours(model, fused)
    while reached:
        body = reached.pop(0)
        for next_one, parts in near[body]:
            if steps[body] + parts < steps.get(next_one, KIN + 1):
                steps[next_one] = steps[body] + parts
                reached.append(next_one)
    return other in steps


def _neighbours(model: mujoco.MjModel, fused: bool) -> list[list[tuple[int, int]]]:
    """For each body those that it is joined to, and how many joints or equalities part the two: 0 or 1."""
    import mujoco

    found: list[list[tuple[int, int]]] = [[] for _ in range(model.nbody)]
    joined = [
        (body, int(model.body_parentid[body]), int(model.body_jntnum[body] > 0))
        for body in range(1, model.nbody)
        if fused or model.body_parentid[body] > 0
    ]
    of_bodies = model.eq_objtype == int(mujoco.mjtObj.mjOBJ_BODY)
    joined += [
        (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), 1)
        for k in np.flatnonzero(of_bodies & (model.eq_obj1id > 0) & (model.eq_obj2id > 0))
    ]
    for one, other, parts in joined:
        found[one].append((other, parts))
        found[other].append((one, parts))
    return found


def _check(found: Settled, names: Labels) -> None:
    if found.pairs and found.amiss > LEFT * found.size:
        one, other = (names.bodies[body] for body in found.pairs[0])
        raise InvalidScene(
            f"start.settle: {one} and {other} overlap by {found.amiss:.3g} in the nearest start that was"
            " found; start.places or start.keyframe can begin elsewhere"
        )
    if found.moved > MOST * found.size:
        raise InvalidScene(
            f"start.settle: the nearest start that is allowed is {found.moved:.3g} away"
            f" ({names.geoms[found.geom]}), more than {MOST:g} of the size of what moves ({found.size:.3g})"
        )


def _lead_along(model: mujoco.MjModel, before: Reals, after: Reals) -> None:
    """Let bodies of motion capture keep their places to the bodies that equalities hold to them."""
    import mujoco

    if not model.nmocap:
        return
    data, body = mujoco.MjData(model), int(mujoco.mjtObj.mjOBJ_BODY)
    for number in np.flatnonzero(model.eq_active0):
        sides = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        led = [side for side in sides if model.body_mocapid[side] >= 0]
        if int(model.eq_objtype[number]) != body or len(led) != 1:
            continue
        other = sides[1] if led[0] == sides[0] else sides[0]
        poses = []
        for q in (before, after):
            data.qpos[:] = q
            mujoco.mj_kinematics(model, data)
            poses.append((data.xpos[other].copy(), data.xquat[other].copy()))
        (was, turned), (at, turns) = poses
        back, apart, place = np.zeros(4), np.zeros(3), np.zeros(3)
        mujoco.mju_negQuat(back, turned)
        mujoco.mju_rotVecQuat(apart, model.body_pos[led[0]] - was, back)
        mujoco.mju_rotVecQuat(place, apart, turns)
        turn, both = np.zeros(4), np.zeros(4)
        mujoco.mju_mulQuat(turn, turns, back)
        mujoco.mju_mulQuat(both, turn, model.body_quat[led[0]])
        model.body_pos[led[0]], model.body_quat[led[0]] = at + place, both


def _of_pairs(built: list[tuple[int, int]], names: Labels) -> list[str]:
    if not built:
        return []
    told = [f"{names.bodies[one]} and {names.bodies[other]}" for one, other in built]
    more = f", and {len(told) - NAMED} pairs more" if len(told) > NAMED else ""
    return [
        f"start.settle: built into each other, so that they do not touch: {', '.join(told[:NAMED])}{more}"
    ]


def _of_motion(names: Labels, before: Reals, found: Settled) -> list[str]:
    change = found.q - before
    changed = np.flatnonzero(change)[np.argsort(-np.abs(change[change != 0.0]))]
    if not len(changed):
        return []
    told = ", ".join(f"{names.coordinates[i]} by {change[i]:+.3g}" for i in changed[:NAMED])
    more = f", and {len(changed) - NAMED} coordinates more" if len(changed) > NAMED else ""
    far = f"by up to {found.moved:.3g}" + (f" ({names.geoms[found.geom]})" if found.geom >= 0 else "")
    return [f"start.settle: moved to the nearest start that is allowed, {far}: {told}{more}"]
