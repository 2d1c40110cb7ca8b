"""Cycles of a hand: fingers let go, go to where they hold the object anew, close on it, and turn it."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.hands.hand import Hand
from rungwise.planning.modes.hands.press import held, is_led, loaded, pressing, rests, targets
from rungwise.planning.modes.hands.touch import CLOSED, Touch, closed, followed, is_clear, opened

POSTURES, NEARBY, SPREAD = 12, 0.6, 0.25
"""Postures of each finger that are drawn; part of them that lies near those that it has, or had at the start;
and how far about these, in parts of the range of its joints."""
ENOUGH, DRAWS = 4, 60
"""Postures from which a finger follows the object, until which more are drawn, and how many at most."""
STEP, STEPS = 0.08, 16
"""How far the object goes in a step, in parts of its size, or radians; and most steps."""
SETS, KEEPS = 60, 0.4
"""Sets of fingers and postures that are compared; and part of them in which fingers that touch the object
stay where they do."""
CLEAR = 0.15
"""Gap, in parts of the size, at which fingers pass the object."""
LOOKS = 6
"""Places on the straight way of fingers at which they are looked at."""
LOOSE = 0.5
"""How much it counts that fingers leave an object other motions, beside what is out of balance."""
YIELDS = (0.02, 0.2)
"""By how much servos yield that press, in radians or parts of the size, at least and at most."""
PARTS = 3
"""Moves in which an object is turned at most."""
TOO_FEW = "fewer than two fingers can touch the object and follow it"
WOULD_FALL = "the object would not rest while fingers let go of it"
CROSSED = "fingers would be in the way of each other"
NO_WAY_THERE = "fingers find no way to where they are to touch the object"


class Stance(NamedTuple):
    """Where fingers are to touch, by their numbers; which of them are there already; and for how many steps
    all follow."""

    touches: dict[int, Touch]
    stays: frozenset[int]
    steps: int


class Wish(NamedTuple):
    """How an object is to change (n_v,), and in how many steps."""

    change: Reals
    steps: int


def wish(hand: Hand, q: Reals, goal: Reals) -> Wish:
    """The change of an object that brings it to a goal (n_q,), or as far as a cycle may lead it."""
    full = hand.around.change(q, goal)
    change = np.zeros_like(full)
    change[hand.columns] = full[hand.columns]
    moves = np.where(np.arange(len(hand.columns)) < hand.around.dimension, 1.0 / hand.size, 1.0)
    length = float(np.linalg.norm(change[hand.columns] * moves))
    steps = max(int(np.ceil(length / STEP)), 2)
    if steps > STEPS:
        change, steps = change * (STEPS / steps), STEPS
    return Wish(change, steps)


class Cycles:
    """What a hand may do next, from where its fingers and the object are. refused: how often, and why,
    nothing came of fingers that were to touch the object."""

    def __init__(self, hand: Hand, home: Reals) -> None:
        """`home` (n_q,): where fingers are at the start."""
        self.hand = hand
        self._home = [finger.chain.joints(home) for finger in hand.fingers]
        self.refused = Counter[str]()

    def proposals(self, q: Reals, goal: Reals, count: int, rng: np.random.Generator) -> list[list[Reals]]:
        """Cycles from a place (n_q,) that lead the object towards a goal (n_q,): for each the targets of the
        joints of all fingers, one after the other (moves of [k joints] per finger)."""
        wanted = wish(self.hand, q, goal)
        pools = [self._pool(f, q, wanted, rng) for f in range(len(self.hand.fingers))]
        found = list[list[Reals]]()
        for stance in self._stances(q, pools, wanted, rng):
            laid = self._laid(q, stance, wanted, rng)
            if laid is not None:
                found.append(laid)
            if len(found) == count:
                break
        return found

    def _pool(self, f: int, q: Reals, wanted: Wish, rng: np.random.Generator) -> list[tuple[bool, Touch]]:
        """Where a finger may touch the object: where it does already (then True), and elsewhere."""
        hand, finger = self.hand, self.hand.fingers[f]
        found = list[tuple[bool, Touch]]()
        now = finger.chain.joints(q)
        for pair in finger.touching:
            if hand.around.near(q, pair).gap < 2.0 * CLOSED * hand.size:
                place = closed(hand, finger, q, pair)
                if place is not None:
                    found.append((True, self._touch(f, place, pair, wanted)))
        span = finger.high - finger.low
        for k in range(DRAWS):
            if k >= POSTURES and sum(touch.steps > 0 for _, touch in found) >= ENOUGH:
                break
            middle = (self._home[f], now)[k % 2]
            near = middle + SPREAD * span * rng.standard_normal(len(span))
            drawn = near if rng.random() < NEARBY else finger.low + span * rng.random(len(span))
            begun = finger.posed(q, drawn)
            pair = finger.touching[int(rng.integers(len(finger.touching)))]
            place = closed(hand, finger, begun, pair)
            if place is not None and is_clear(hand, finger, place, pair):
                found.append((False, self._touch(f, place, pair, wanted)))
        return [own for own in found if own[1].steps > 0]

    def _touch(self, f: int, q: Reals, pair: int, wanted: Wish) -> Touch:
        return followed(
            self.hand, self.hand.fingers[f], q, pair, wanted.change, wanted.steps, self._home[f]
        )  # fmt: skip

    def _stances(
        self, q: Reals, pools: list[list[tuple[bool, Touch]]], wanted: Wish, rng: np.random.Generator
    ) -> list[Stance]:
        """Sets of touches, those that lead the object farthest in balance first."""
        able = [f for f, pool in enumerate(pools) if pool]
        found = list[tuple[float, Stance]]()
        if len(able) < 2:
            self.refused[TOO_FEW] += 1
            return []
        for _ in range(SETS):
            size = int(rng.integers(2, len(able) + 1))
            chosen = sorted(rng.permutation(able)[:size].tolist())
            keeps = rng.random() < KEEPS
            picked = {f: self._picked(pools[f], keeps, rng) for f in chosen}
            steps = min(touch.steps for _, touch in picked.values())
            stays = frozenset(f for f, (stay, _) in picked.items() if stay)
            stance = Stance({f: touch for f, (_, touch) in picked.items()}, stays, steps)
            firmness = min(self._firmness(q, stance, wanted, k) for k in (0, steps))
            found.append((steps / wanted.steps * firmness * rng.uniform(0.7, 1.0), stance))
        found.sort(key=lambda own: -own[0])
        return [stance for _, stance in found]

    def _picked(
        self, pool: list[tuple[bool, Touch]], keeps: bool, rng: np.random.Generator
    ) -> tuple[bool, Touch]:
        """One of the touches of a finger, rather one that follows far; with `keeps`, one that it has."""
        pool = [each for each in pool if keeps and each[0]] or pool
        far = np.array([touch.steps for _, touch in pool], float) ** 2
        return pool[int(rng.choice(len(pool), p=far / far.sum()))]

    def _firmness(self, q: Reals, stance: Stance, wanted: Wish, step: int) -> float:
        """How well fingers lead the object after so many steps, 1 at best: less by what is out of balance, in
        parts of its load, and where they leave it other motions."""
        place = self._placed(q, stance, wanted, step)
        pairs = [touch.pair for touch in stance.touches.values()]
        press = loaded(self.hand, place) or 1.0
        off = held(self.hand, place, pairs, press, wanted.change).off
        return 1.0 - off - (0.0 if is_led(self.hand, place, pairs, wanted.change) else LOOSE)

    def _placed(self, q: Reals, stance: Stance, wanted: Wish, step: int) -> Reals:
        """The place (n_q,) of object and fingers after so many steps."""
        place = self.hand.around.changed(q, wanted.change * (step / wanted.steps))
        for f, touch in stance.touches.items():
            place = self.hand.fingers[f].posed(place, touch.joints[step])
        return place

    def _laid(self, q: Reals, stance: Stance, wanted: Wish, rng: np.random.Generator) -> list[Reals] | None:
        """A cycle as targets of joints; None where fingers would be in the way of each other, or the object
        would not rest."""
        hand, fingers = self.hand, self.hand.fingers
        deflection = float(np.exp(rng.uniform(*np.log(YIELDS))))
        leaves = len(stance.stays) < len(stance.touches)
        kept = [stance.touches[f].pair for f in stance.stays]
        if leaves and not rests(hand, q, kept, 1.0):
            self.refused[WOULD_FALL] += 1
            return None
        begun = self._placed(q, stance, wanted, 0)
        end = self._placed(q, stance, wanted, stance.steps)
        free = self._apart(q, stance)
        for place in (begun, end):
            own = place
            for f, joints in free.items():
                own = fingers[f].posed(own, joints)
            if not self._are_apart(own):
                self.refused[CROSSED] += 1
                return None
        moves = list[dict[int, Reals]]()
        if leaves:
            way = self._way(q, begun, stance, free)
            if way is None:
                self.refused[NO_WAY_THERE] += 1
                return None
            moves += way
        press = min(
            pressing(hand, fingers[f], begun, touch.pair, deflection) for f, touch in stance.touches.items()
        )
        if leaves:
            moves.append(self._pressed(q, stance, wanted, 0, press))
        count = min(PARTS, max(1, stance.steps // 2))
        for step in np.linspace(0, stance.steps, count + 1)[1:]:
            moves.append(self._pressed(q, stance, wanted, round(float(step)), press))
        last = {f: targets(hand, fingers[f], q, -1, np.zeros(0)) for f in range(len(fingers))}
        found = list[Reals]()
        for move in moves:
            last = last | move
            found.append(np.concatenate([last[f] for f in range(len(fingers))]))
        return found

    def _apart(self, q: Reals, stance: Stance) -> dict[int, Reals]:
        """Joints (k,) at which fingers that do not touch are away from the object."""
        return {
            f: finger.chain.joints(opened(self.hand, finger, q, CLEAR * self.hand.size))
            for f, finger in enumerate(self.hand.fingers)
            if f not in stance.touches
        }

    def _way(
        self, q: Reals, begun: Reals, stance: Stance, free: dict[int, Reals]
    ) -> list[dict[int, Reals]] | None:
        """Targets of fingers that leave the object and come to where they are to touch it, at a distance."""
        hand, gap = self.hand, CLEAR * self.hand.size
        away, before = dict[int, Reals](), dict[int, Reals]()
        for f, finger in enumerate(hand.fingers):
            if f in stance.stays:
                continue
            away[f] = finger.chain.joints(opened(hand, finger, q, gap))
            before[f] = free[f] if f in free else finger.chain.joints(opened(hand, finger, begun, gap))
        moves = [away]
        for detour in (None, self._home):
            via = before if detour is None else {f: detour[f] for f in before}
            legs = [(away, via)] if detour is None else [(away, via), (via, before)]
            if all(self._passes(q, a, b) for a, b in legs):
                moves += [b for _, b in legs]
                return [self._held_at(q, move) for move in moves]
        return None

    def _held_at(self, q: Reals, joints: dict[int, Reals]) -> dict[int, Reals]:
        """Targets of servos that carry fingers at these joints."""
        found = dict[int, Reals]()
        for f, own in joints.items():
            finger = self.hand.fingers[f]
            found[f] = targets(self.hand, finger, finger.posed(q, own), -1, np.zeros(0))
        return found

    def _passes(self, q: Reals, a: dict[int, Reals], b: dict[int, Reals]) -> bool:
        """Whether fingers pass straight from some joints to others, together."""
        for at in np.linspace(0.0, 1.0, LOOKS + 1)[1:]:
            place = q
            for f in a:
                place = self.hand.fingers[f].posed(place, (1.0 - at) * a[f] + at * b[f])
            if not self._are_apart(place):
                return False
            if not all(is_clear(self.hand, self.hand.fingers[f], place) for f in a):
                return False
        return True

    def _are_apart(self, q: Reals) -> bool:
        """Whether no fingers overlap each other."""
        gaps = self.hand.around.least(q, self.hand.between)
        return bool((gaps > 0.0).all())

    def _pressed(self, q: Reals, stance: Stance, wanted: Wish, step: int, press: float) -> dict[int, Reals]:
        """Targets of the fingers that touch, after so many steps."""
        place = self._placed(q, stance, wanted, step)
        pairs = [touch.pair for touch in stance.touches.values()]
        forces = held(self.hand, place, pairs, press, wanted.change if step else None).forces
        return {
            f: targets(self.hand, self.hand.fingers[f], place, touch.pair, force)
            for (f, touch), force in zip(stance.touches.items(), forces, strict=True)
        }


def inputs(hand: Hand, levels: Reals, joints: Reals) -> Reals:
    """Inputs (u,) that lead the joints of all fingers to targets, beside those that lead others (u,)."""
    found, at = levels.copy(), 0
    for finger in hand.fingers:
        own, count = finger.driven, len(finger.loose)
        columns = list(own.columns)
        wanted = joints[at : at + count]
        now = own.led.matrix @ levels[columns] + own.led.zero
        wanted = np.where(finger.loose, wanted, now)
        found[columns] = own.levels(wanted[None], wanted[None])[0]
        at += count
    return found
