"""Objects that gravity, and fingers, press on contacts that slide: their friction as a support.

Where fingers leave an object several motions, as one that pushes a box on a floor does, the friction of the
contacts on which it lies says which it makes. Contacts yield alike under their normal forces N_i, which
are thus the least that balance weight and push. Sliding ones resist with mu_i N_i against their slips
s_i = T_i v. Near a motion v that is the friction of an ellipsoid, sum mu_i N_i |T_i v|^2 / |s_i|, as the
limit surface of a support is (Howe and Cutkosky, Practical force-motion models for sliding manipulation,
1996). Weighed anew by the slips of the motion that came of it (iteratively reweighted least squares), it
becomes Coulomb's law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.forces.cones import PART, RANK, SLIDE, STICK, ring_of

CARRIES = 1e-3
"""Part of the weight above which a contact carries it."""
STANDS = 0.1
"""Part of the weight that may be left unbalanced while an object is pushed, for steps are finite."""
LEAST = 0.05
"""Slip, over the mean one, below which friction is taken to grow with the slip."""


@dataclass(frozen=True)
class Lying:
    """Contacts that an object keeps in a mode: normals (e, k), tangents (e, t, k), over its units, friction
    (e,), and what they do (e,), with those that modes do not tell apart; and the weight (k,) on them."""

    normals: Reals
    tangents: Reals
    friction: Reals
    kinds: Ints
    weight: Reals

    def normal_forces(self, wrench: Reals) -> Reals | None:
        """The least normal forces (e,) that balance weight and a push (k,), with whatever friction; None
        where none do."""
        load, free = -(self.weight + wrench), self.tangents.reshape(-1, len(wrench))
        scale, on = float(np.linalg.norm(self.weight)), np.ones(len(self.friction), bool)
        for _ in range(len(on)):
            columns = np.vstack([self.normals[on], free]).T
            found = np.linalg.lstsq(columns, load, rcond=RANK)[0]
            if np.linalg.norm(columns @ found - load) > CARRIES * scale:
                return None
            own = found[: int(on.sum())]
            if (own >= -CARRIES * scale).all():
                forces = np.zeros(len(on))
                forces[on] = np.maximum(own, 0.0)
                return forces
            on[np.flatnonzero(on)[own.argmin()]] = False
        return None

    def support(self, forces: Reals, slips: Reals | None = None) -> tuple[Reals, float] | None:
        """Rows (r, k) of the support that sliding contacts with these normal forces (e,) are within the
        motions that the mode allows, near a motion with these slips (e,), and its greatest force; None where
        none slides under a force."""
        bears = forces > CARRIES * float(np.linalg.norm(self.weight))
        limits = np.where((self.kinds == SLIDE) & bears, self.friction * forces, 0.0)
        limit = float(limits.sum())
        if not limit > 0.0:
            return None
        weights = limits / limit
        if slips is not None and float(weights @ slips) > 0.0:
            weights = weights / np.maximum(slips / float(weights @ slips), LEAST)
        size = self.normals.shape[1]
        rows = (np.sqrt(weights)[:, None, None] * self.tangents)[limits > 0.0].reshape(-1, size)
        held = np.vstack([self.normals, self.tangents[self.kinds == STICK].reshape(-1, size)])
        return rows - rows @ np.linalg.pinv(held, rcond=RANK) @ held, limit

    def slips(self, change: Reals) -> Reals:
        """How far contacts slip (e,) in a change (k,)."""
        return np.asarray(np.linalg.norm(self.tangents @ change, axis=1))

    def stands(
        self, forces: Reals, wrench: Reals, change: Reals, within: float = STANDS, reserve: float = 0.0
    ) -> bool:
        """Whether these normal forces (e,), the friction of contacts that slide in a change (k,), and as much
        as those that stick can hold with a reserve, nearly balance weight and a push (k,)."""
        slips, limits = self.tangents @ change, self.friction * forces
        length = np.linalg.norm(slips, axis=1)
        slides = (self.kinds == SLIDE) & (length > 0.0)
        left = self.weight + wrench + self.normals.T @ forces
        ways = slips[slides] / length[slides, None]
        left = left - np.einsum("e,et,etk->k", limits[slides], ways, self.tangents[slides])
        scale, holding = float(np.linalg.norm(self.weight)), np.flatnonzero(~slides & (limits > 0.0))
        if not len(holding):
            return bool(np.linalg.norm(left) <= within * scale)
        ring = ring_of(self.tangents.shape[1])
        columns = [(1.0 - reserve) * limits[k] * ring @ self.tangents[k] / scale for k in holding]
        # The parts of each cone add up to one at most, with one that does nothing.
        sums = np.kron(np.eye(len(holding)), np.ones(len(ring)))
        rows = np.vstack([np.vstack(columns).T, sums])
        idle = np.vstack([np.zeros((len(left), len(holding))), np.eye(len(holding))])
        _, off = nnls(np.hstack([rows, idle]), np.concatenate([-left / scale, np.ones(len(holding))]))
        return bool(off <= within)


def lying(mode: Ints, normals: Reals, tangents: Reals, friction: Reals, weight: Reals) -> Lying | None:
    """The contacts (e,) that a mode keeps, with the weight (k,) of the object; None where there are none, or
    no weight."""
    kept = mode != PART
    if not kept.any() or not float(np.linalg.norm(weight)) > 0.0:
        return None
    return Lying(normals[kept], tangents[kept], friction[kept], mode[kept], weight)
