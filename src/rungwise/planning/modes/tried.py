"""Which fingers change their places, and where they then touch an object: before they are placed there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.fingers import Flags
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.outlines import alike, opposite
from rungwise.world.carriers import frame_of

PAIRS, TRIES = 24, 60
"""Pairs of opposite places on the outline, of which some are drawn for fingers; and how often, for a mode."""
LEAVES, IDLE = 0.6, 0.25
"""How often a finger changes its place, and then touches nothing."""
ALONE = 0.2
"""How often a finger at a given speed pushes alone, where others could push beside it."""
OPPOSITE = 0.5
"""How often a finger is placed across the object from another."""


def draws(ground: Ground, used: Ints, rng: np.random.Generator) -> Iterator[tuple[Ints, Ints, Ints]]:
    """Which fingers change places (f,), which touch the object then (f,), and where in the pool (f,); a
    finger that is alone touches at each of its places in turn."""
    if (ground.own >= 0).sum() > 1:
        for _ in range(TRIES):
            yield _drawn(ground, used, rng)
        return
    for place in rng.permutation(2 * PAIRS):
        changes, own, picked = _drawn(ground, used, rng)
        picked[:] = place
        yield changes, own, picked


def _drawn(ground: Ground, used: Ints, rng: np.random.Generator) -> tuple[Ints, Ints, Ints]:
    """Which fingers change places (f,), which touch the object then (f,), and where in the pool (f,)."""
    count, can = len(ground.fingers), np.flatnonzero(ground.own >= 0)
    changes = np.zeros(count, np.int64)
    changes[can] = (rng.random(len(can)) < LEAVES) | (used[can] == 0)
    if not changes.any():
        changes[rng.choice(can)] = 1
    own = used * (1 - changes)
    touching = np.flatnonzero(changes)
    own[touching] = rng.random(len(touching)) >= (IDLE if len(can) > 1 else 0.0)
    if not own.any():
        own[rng.choice(touching)] = 1
    picked = rng.integers(2 * PAIRS, size=count)
    if not ground.fingers[0].carrier.by_place and own.sum() > 1:
        _at_speeds(used, changes, own, picked, rng)
        return changes, own, picked
    held, moved = np.flatnonzero(own), np.flatnonzero(changes * own)
    if len(held) > 1 and len(moved) and rng.random() < OPPOSITE:
        one = int(rng.choice(moved))
        other = int(rng.choice(held[held != one]))
        picked[one] = (picked[other] + PAIRS) % (2 * PAIRS) if changes[other] else 2 * PAIRS + other
    return changes, own, picked


def _at_speeds(used: Ints, changes: Ints, own: Ints, picked: Ints, rng: np.random.Generator) -> None:
    """Let fingers at given speeds push side by side, where two would jam what is between them: beside one
    that is drawn, or that stays; or let that one push alone."""
    staying = np.flatnonzero(own * used * (1 - changes))
    one = int(rng.choice(staying if len(staying) else np.flatnonzero(own)))
    if rng.random() < ALONE:
        changes[(own > 0) & (used > 0) & (np.arange(len(own)) != one)] = 1
        own[:] = 0
        own[one] = 1
        return
    for f in np.flatnonzero(own):
        if f != one:
            changes[f] = 1
            picked[f] = 2 * PAIRS + len(own) + (len(own) + picked[one] if changes[one] else one)


def pool(ground: Ground, seen: Seen, used: Ints, rng: np.random.Generator) -> Reals:
    """Parts of the outline of which some are drawn: any, then those opposite of them, then those opposite of
    each finger, as far as it touches; where fingers move at given speeds, then parts beside each finger, and
    beside all that come first."""
    drawn = rng.random(PAIRS)
    places = np.array([ground.part(seen, f)[0] if used[f] else 0.0 for f in range(len(used))])
    outline = ground.around.outline(ground.body)
    found = np.concatenate([drawn, opposite(outline, np.concatenate([drawn, places]), ground.task.size)])
    if ground.fingers[0].carrier.by_place or len(used) == 1:
        return found
    return np.concatenate([found, alike(outline, np.concatenate([places, found[: 2 * PAIRS]]), rng)])


def covered(ground: Ground, seen: Seen, parts: Reals) -> Flags:
    """At which parts of the outline (m,) surroundings are too near for a finger to touch the object."""
    _, turned = frame_of(seen.touches.poses[ground.body])
    points, normals = ground.around.outline(ground.body)(parts)
    room = ground.around.room(seen.q, ground.body, points, normals @ turned.T, ground.pairs)
    return np.asarray(room < ground.kept_apart.min(initial=np.inf))


def supposed(ground: Ground, seen: Seen, changes: Ints, own: Ints, parts: Reals) -> Seen:
    """What would touch where those of the fingers (f,) that change their places, and are to touch, touched
    the object at these parts (f,) of its outline: they are taken for what stands still."""
    placed, touches = np.flatnonzero(changes * own), seen.touches
    at, turned = frame_of(touches.poses[ground.body])
    points, normals = ground.around.outline(ground.body)(parts[placed])
    inward, held = -normals @ turned.T, np.where(changes > 0, -1, seen.held)
    held[placed] = len(touches.gaps) + np.arange(len(placed))
    none = np.full(len(placed), -1)
    return seen._replace(
        held=held,
        touches=touches._replace(
            pairs=np.append(touches.pairs, ground.own[placed]),
            features=np.append(touches.features, none), faces=np.append(touches.faces, none),
            gaps=np.append(touches.gaps, np.zeros(len(placed))),
            points=np.vstack([touches.points, at + points @ turned.T]),
            normals=np.vstack([touches.normals, inward]),
            rows=np.vstack([touches.rows, ground.around.rows(seen.q, ground.body, points, inward)]),
            friction=np.append(touches.friction, ground.frictions[placed]),
        ),
    )  # fmt: skip
