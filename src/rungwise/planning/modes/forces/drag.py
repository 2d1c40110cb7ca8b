"""Objects that gravity presses on contacts that slide: their friction as a support.

Where fingers leave an object several motions, as one that pushes a box on a floor does, the friction of the
contacts on which it lies says which it makes. Sliding contacts with normal forces N_i resist with mu_i N_i
against their slips T_i v; that is taken for an ellipsoid, with the quadratic form sum mu_i N_i |T_i v|^2, as
the limit surface of a support is (Howe and Cutkosky, Practical force-motion models for sliding manipulation,
1996). The forces are those that carry the weight alone.
"""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.forces import cones
from rungwise.planning.modes.forces.cones import PART, RANK, SLIDE, STICK, Memory

CARRIES = 1e-3
"""Part of the weight above which a contact carries it."""
STANDS = 0.1
"""Part of the weight that may be left unbalanced while an object is pushed, for the ellipsoid is not the
limit surface."""


def support_by_contacts(mode: Ints, weight: Reals, memory: Memory) -> tuple[Reals, float] | None:
    """Rows (r, k) of the support that contacts which slide in a mode (e,) are to an object of this weight
    (k,), within the motions that the mode allows, and its greatest force; None where they do not carry it.
    The friction of these contacts in memory is 0 from then on."""
    scale, none = float(np.linalg.norm(weight)), np.zeros(0)
    kept, tangents = np.flatnonzero(mode != PART), memory.ring.shape[1]
    if not scale > 0.0 or not len(kept):
        return None
    holds = np.where(mode == PART, PART, STICK)
    end = cones.contact_edges(holds, np.zeros(len(weight)), 0.0, memory, 0)
    if not cones.balances(end, 0, weight, scale, none, memory):
        return None
    cones.center(end, 0, scale, none, memory)
    normal = np.zeros(len(mode))
    normal[kept] = memory.share[:end].reshape(len(kept), -1).sum(axis=1)
    slides = (mode == SLIDE) & (normal > CARRIES * scale)
    limits = np.where(slides, memory.friction[: len(mode)] * normal, 0.0)
    limit = float(limits.sum())
    if not limit > 0.0:
        return None
    rubs = memory.tangents[: tangents * len(mode)].reshape(len(mode), tangents, -1)
    rows = (np.sqrt(limits / limit)[:, None, None] * rubs)[slides].reshape(-1, len(weight))
    held = np.vstack([memory.normals[kept], rubs[mode == STICK].reshape(-1, len(weight))])
    memory.friction[: len(mode)][slides] = 0.0
    return rows - rows @ np.linalg.pinv(held, rcond=RANK) @ held, limit


def stands(mode: Ints, change: Reals, weight: Reals, wrench: Reals, memory: Memory) -> bool:
    """Whether contacts that a mode keeps (e,) balance weight and a push (k,), nearly, as the object changes
    (k,)."""
    scale, end = float(np.linalg.norm(weight)), cones.contact_edges(mode, change, 0.0, memory, 0)
    cones.balances(end, 0, weight + wrench, scale, np.zeros(0), memory)
    left = memory.left[: len(weight)]
    return bool(np.linalg.norm(left) <= STANDS)
