"""The contract between a system and the models: all data of a step, as arrays.

A system fills `Terms` at (t, q, v); models assemble from `Terms` only. Shapes: n coordinates, c contacts of d
directions each (normal first; d = 2 in the plane, 3 in space), b force-limited rows. Arrays may be longer
than the `contacts` in use. In the plane v is the rate of q (G = 1), M is constant and k vanishes, because
coordinates belong to centres of mass.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.contact.step import Widths, whole_matrix, whole_rows
from rungwise.system.entries import Entries, allocate_entries

DRIVE, SUPPORT, JOINT = 0, 1, 2
"""Accounts of energy that the work of a limited row may belong to."""
INERTIA, METRIC = 0, 1
"""Columns of `heft`."""
APART = -1
"""Surface of a row whose force has an interval of its own."""


class Terms(Block):
    """The data of a system at one state. Units: force F, length L, time T of the scene.

    inertia    (n, n)    M, at q
    metric     (n, n)    M per unit of each body's mass (kinematic rung)
    heft       (n, 2)    row sums of |M| and of |metric|: diag(heft) - M is positive semidefinite, so
                         that heft stands for M where only its size matters
    stiffness  (n, n)    -d(load)/dq of servos and potentials
    damping    (n, n)    -d(load)/dv of servos and supports
    load       (n,)      all non-contact force at (t + h, q, v = 0), and eps k where bodies have momentum
    fall       (n,)      M^-1 load on the free coordinates: acceleration without contacts, for eps = 1
    gap        (c,)      psi
    rows       (c d, n)  d(psi)/dt and tangential speed per unit of v: rows of W^T
    lever      (c,)      length per unit of the angle that a travel limit bounds; 1 for other contacts
    friction   (c,)      mu
    restitution (c,)     e
    contact_stiffness, contact_damping (c, d, d)  K, C
    deformation (c d,)   delta at the start of the step
    skew       (c, 3)    friction that differs by direction (see `system.skew`): rows of slip, and what goes
                         with them, are as if it did not; empty where no contact has such
    limited    (b, n)    rows S^T of force-limited drives and dry friction: lengths, as for contacts
    limit      (b,)      F
    gains      (b, 2)    K_p, K_d of the row (0, 0 for dry friction; infinite K_p: rigid)
    error      (b, 2)    q_d - q at the end of the step with v = 0, and v_d
    account    (b,)      the account of its work: DRIVE, SUPPORT or JOINT
    surface    (b,)      rows of the same number share a limit surface, sum (tau / F)^2 <= 1; APART: none
    exact      (m, 4)    limit surfaces of a pressure in place of the ellipsoid: their first row (-1: none),
                         cosine and sine of the body's angle, and where their numbers begin in `pressures`
    pressures  (p,)      numbers of pressures (see `contact.kinds.pressure`)
    rounding   (1,)      length below which positions are rounding
    pause      (1,)      time: an approach no faster than loads cause within it is rest, not impact
    low        (1,)      height: an approach after which loads let nothing bounce higher is rest
    entries              where rows and matrices of many bodies have entries: these alone are kept then, of
                         `rows`, inertia, metric, stiffness and damping, as `contact.step.spans` says
    """

    inertia: NDArray[np.float64]
    metric: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    heft: NDArray[np.float64]
    load: NDArray[np.float64]
    fall: NDArray[np.float64]
    gap: NDArray[np.float64]
    rows: NDArray[np.float64]
    lever: NDArray[np.float64]
    friction: NDArray[np.float64]
    restitution: NDArray[np.float64]
    contact_stiffness: NDArray[np.float64]
    contact_damping: NDArray[np.float64]
    deformation: NDArray[np.float64]
    skew: NDArray[np.float64]
    limited: NDArray[np.float64]
    limit: NDArray[np.float64]
    gains: NDArray[np.float64]
    error: NDArray[np.float64]
    account: NDArray[np.int64]
    surface: NDArray[np.int64]
    exact: NDArray[np.float64]
    pressures: NDArray[np.float64]
    rounding: NDArray[np.float64]
    pause: NDArray[np.float64]
    low: NDArray[np.float64]
    entries: Entries


def allocate_terms(
    coordinates: int,
    contacts: int,
    limited: int,
    directions: int = 2,
    widths: Widths | None = None,
    surfaces: dict[str, NDArray[np.float64]] | None = None,
    skewed: bool = False,
) -> Terms:
    """Zeroed terms for at most so many contacts and force-limited rows; with `widths` of the entries that are
    kept; `surfaces`: exact and pressures, of which there are none by default; `skewed`:
    friction may differ by direction."""
    n, c, d, b = coordinates, contacts, directions, limited
    wide = Widths(n, n) if widths is None else widths
    return Terms(
        inertia=np.zeros((n, wide.matrices)),
        metric=np.zeros((n, wide.matrices)),
        stiffness=np.zeros((n, wide.matrices)),
        damping=np.zeros((n, wide.matrices)),
        heft=np.zeros((n, 2)),
        load=np.zeros(n),
        fall=np.zeros(n),
        gap=np.zeros(c),
        rows=np.zeros((c * d, wide.rows)),
        lever=np.ones(c),
        friction=np.zeros(c),
        restitution=np.zeros(c),
        contact_stiffness=np.zeros((c, d, d)),
        contact_damping=np.zeros((c, d, d)),
        deformation=np.zeros(c * d),
        skew=np.tile([1.0, 0.0, 1.0], (c if skewed else 0, 1)),
        limited=np.zeros((b, n)),
        limit=np.zeros(b),
        gains=np.zeros((b, 2)),
        error=np.zeros((b, 2)),
        account=np.zeros(b, np.int64),
        surface=np.full(b, APART),
        **(surfaces or {"exact": np.zeros((0, 4)), "pressures": np.zeros(0)}),
        rounding=np.zeros(1),
        pause=np.zeros(1),
        low=np.zeros(1),
        entries=allocate_entries(n, c, widths),
    )


def rows_of(terms: Terms, contacts: int) -> NDArray[np.float64]:
    """A dense copy (c, d, n) of the rows of the first contacts."""
    d, n = terms.contact_stiffness.shape[1], len(terms.load)
    rows = whole_rows(terms.rows[: contacts * d], terms.entries.rows, d, n)
    return rows.reshape(contacts, d, n)


def whole(terms: Terms, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """A dense copy (n, n) of one of the matrices."""
    return whole_matrix(matrix, terms.entries.matrices, len(terms.load))


def normals_of(terms: Terms, contacts: int) -> NDArray[np.float64]:
    """A dense copy (c, n) of the normal rows of the first contacts."""
    return rows_of(terms, contacts)[:, 0]
