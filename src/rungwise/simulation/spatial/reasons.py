"""Why runs in space end, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space.labels import Labels
from rungwise.simulation.core.crawl import CAUSES, why_nowhere
from rungwise.simulation.core.tolerances import NEAR
from rungwise.simulation.moving.snaps import led_on, snaps
from rungwise.simulation.reasons.hindered import LEADING_ON, LONGER
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.spatial.reach import rate_of
from rungwise.system.spatial.space import Space
from rungwise.wording import listed

MOST_NAMED = 4
"""Most pairs of bodies that a reason names."""


def fastest(space: Space, names: Sequence[str], v: Reals) -> str:
    """The body that moves fastest at v (n_v,)."""
    speeds = [rate_of(space.reaches, space.solids.span, b, v) for b in range(len(space.reaches))]
    return names[int(np.argmax(speeds))]


def snapped(stepper: Stepper, space: Space, names: Sequence[str]) -> str:
    """Which body left its balance, when and how far, and what touched it."""
    model, name = space.model, fastest(space, names, stepper.scratch.v_new)
    pushed = space.kept.geoms[np.flatnonzero(stepper.state.force[: space.most, 0] > 0.0)]
    pairs = {tuple(model.geom_bodyid[pair].tolist()) for pair in pushed}
    near = sorted("|".join(names[x] for x in pair) for pair in pairs if name in {names[x] for x in pair})
    at = f" at {listed(near)}" if near else ""
    return snaps(stepper, name, at)


def stuck(stepper: Stepper, space: Space, names: Sequence[str]) -> str:
    """What a step lacks that has neither a solution nor a proof, at which contacts, and what may lead on."""
    slots = stepper.scratch.slots[: stepper.contacts]
    closed = slots[stepper.terms.gap[: stepper.contacts] <= NEAR * space.size.length]
    pairs = space.model.geom_bodyid[space.geoms(closed[closed < space.most])]
    told = sorted({"|".join(names[x] for x in sorted(pair)) for pair in pairs.tolist()})
    more = [f"{len(told) - MOST_NAMED} more"] if len(told) > MOST_NAMED else []
    return led_on(stepper, f" at {listed([*told[:MOST_NAMED], *more])}" if told else "")


def crawled(stepper: Stepper, space: Space, labels: Labels) -> str:
    """What kept the steps short of a run whose steps led nowhere, the body that was fastest, and what may
    lead on."""
    clock = stepper.clock
    blamed = int(clock["blamed"])
    cause, slot = blamed % CAUSES, blamed // CAUSES
    short = (
        " ".join(LONGER[cause].format(at=_at(slot, space, labels.geoms)).split()) if cause in LONGER else ""
    )
    lines = [
        why_nowhere(int(clock["crowd"]), stepper.time - float(clock["mark"]), stepper.step, short),
        f"The fastest body is {fastest(space, labels.bodies, stepper.v)}.",
        "A smaller step, or tol, may help.",
    ]
    if stepper.rung.name in LEADING_ON:
        lines.append(f"If that changes nothing, {LEADING_ON[stepper.rung.name]}.")
    return f"{lines[0]}. {' '.join(lines[1:])}"


def _at(slot: int, space: Space, geoms: Sequence[str]) -> str:
    """Between which geoms a slot's contact is, or that it is a limit."""
    if not 0 <= slot < space.most:
        return "at a limit" if slot >= 0 else ""
    a, b = space.geoms(np.array([slot]))[0].tolist()
    return f"between {geoms[a]} and {geoms[b]}" if a >= 0 else ""
