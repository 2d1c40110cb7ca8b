"""The nearest start that is allowed, where a model's own start is not.

    min |x - x0| over places x with gaps >= 0, equalities closed, and joints within their ranges

The distance is the kinematic rung's: of all bodies' points, where each body has mass 1 and its own radii of
gyration. Algorithm: sequential quadratic programming from x0; each program is a least distance problem
(Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23), whose rows yield a little, so that
demands that contradict each other are met as far as they can be.
"""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene.space.mujoco_model import of_unit_mass

if TYPE_CHECKING:
    import mujoco

ROUNDS = 80
"""Quadratic programs, at most. Chosen by trial."""
CLOSED, CLEAR = 1e-9, 5e-6
"""Overlap, opening, or passing of a range over the model's size that is rounding, and the gap that is left
where bodies overlapped by more. Chosen by trial, to a decade, below what a run allows at its start."""
ROUGH = 5e-5
"""Gap of meshes over the model's size that is left beside others: their depths are known less well. Chosen by
trial."""
EXACT, SEARCHES = 1e-10, 200
"""Error of MuJoCo's search for the nearest points of two convex geoms, and its iterations: its own, 1e-6 and
35, are as great as the overlap that rigid contacts allow. Chosen by trial."""
BEYOND = 0.05
"""Part of an overlap by which bodies are asked to part beyond it: what collision finds of meshes is rough."""
ROUNDED = 1e-6
"""Overlap over the model's size from which on bodies count as built into each other. Chosen by trial."""
FAR = 0.1
"""Motion of one round over the model's size, at most: rows are linear there. Chosen by trial."""
NEAR = 0.02
"""Gaps over the model's size within which contacts are looked for. Chosen by trial."""
YIELD = 1e-3
"""Root of what a demand yields by under its multiplier, where bodies yield by about 1. Chosen by trial."""
HALVINGS = 12
"""Shorter steps that are tried where a step leads to more that is amiss."""
FIRM = 1e4
"""What turns of free bodies weigh more where steps gain little: depths change steadily as bodies move, not
as they turn. Chosen by trial."""
GAIN = 0.5
"""Part of what is amiss, squared, down to which a step gains little. Chosen by trial."""
KEPT = 16
"""Answers that are kept."""
MOST = 0.5
"""Motion over the model's size beyond which the start is another one, not the one that was meant."""


@dataclass(frozen=True)
class Settled:
    """Places (n_q,), what is still amiss there, and how far a geom moved, as lengths; `size` is the length of
    what moves, `geom` the one that moved farthest, or -1; `pairs`: bodies that still overlap, the deepest
    first."""

    q: Reals
    amiss: float
    pairs: tuple[tuple[int, int], ...]
    moved: float
    size: float
    geom: int


def settle(model: mujoco.MjModel, start: Reals) -> Settled:
    """The allowed places nearest to `start` (n_q,), or those where least is amiss. Answers are kept: a search
    binds its scene many times."""
    found = _settled(_Asked(_digest(model, start), model, start))
    return replace(found, q=found.q.copy())


@dataclass(frozen=True)
class _Asked:
    """A model and a start, told apart by the digest of all their numbers."""

    digest: bytes
    model: mujoco.MjModel = field(compare=False)
    start: Reals = field(compare=False)


def _digest(model: mujoco.MjModel, start: Reals) -> bytes:
    import mujoco

    whole = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, whole)
    return hashlib.sha256(whole.tobytes() + start.tobytes()).digest()


@lru_cache(maxsize=KEPT)
def _settled(asked: _Asked) -> Settled:
    found = _Search(asked.model, asked.start)
    found.run()
    return found.result()


class _Search:
    def __init__(self, model: mujoco.MjModel, start: Reals) -> None:
        import mujoco

        self.mujoco, self.start = mujoco, start.copy()
        m = self.model = copy.copy(model)
        self.moving = np.flatnonzero((m.body_weldid[m.geom_bodyid] != 0) & (m.geom_rbound > 0.0))
        m.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        m.opt.ccd_tolerance, m.opt.ccd_iterations = min(m.opt.ccd_tolerance, EXACT), SEARCHES
        self.data = mujoco.MjData(m)
        self.first = self._geoms(start)
        self.size = self._size()
        near = NEAR * self.size
        for margin in (m.geom_margin, m.pair_margin, m.jnt_margin, m.tendon_margin):
            np.maximum(margin, near, out=margin)
        m.geom_gap[:], m.pair_gap[:] = 0.0, 0.0
        self.unit = of_unit_mass(m)
        self.unit_data = mujoco.MjData(self.unit)
        mujoco.mj_setConst(self.unit, self.unit_data)
        self.lever = self._levers()
        free = m.jnt_dofadr[m.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        self.turns = (free[:, None] + np.arange(3, 6)).ravel()
        self.captured, self.rough = self._captured(), 0.0
        faced = (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_MESH)
        self.is_faced = bool(np.isin(m.geom_type, faced).any())
        self.best, self.amiss = start.copy(), 0.0

    def run(self) -> None:
        """Look for allowed places where something is amiss by more than rounding: at all, then as near as
        they can be, then to rounding."""
        self.amiss = self._demands(self.start).amiss
        if self.amiss <= CLOSED * self.size:
            return
        self.rough = ROUGH * self.size
        for beyond in (BEYOND, 0.0):
            self._open(beyond)
            if self.amiss > ROUNDED * self.size:
                return
            self._go_back()
        self._open(0.0, least=True)

    def _open(self, beyond: float, least: bool = False) -> None:
        """Take steps until none makes what is amiss less; the `least` ones, or those nearest to the start.
        Where they gain little, bodies are moved more than turned."""

        def is_better(_: Reals, there: _Demands, here: _Demands) -> bool:
            return there.sum < here.sum

        here = self._demands(self.best, beyond)
        for _ in range(ROUNDS):
            found = self._halved(self._step(here, least), beyond, here, is_better)
            if found is None or found[1].sum > GAIN * here.sum:
                other = self._halved(self._step(here, True, FIRM), beyond, here, is_better)
                found = min((each for each in (found, other) if each), key=lambda x: x[1].sum, default=None)
            if found is None:
                break
            self.best, here = found
        self.amiss = here.amiss

    def _go_back(self) -> None:
        """Take steps towards the start for as long as they stay allowed."""

        def is_nearer(tried: Reals, there: _Demands, _: _Demands) -> bool:
            if there.amiss > ROUNDED * self.size:
                return False
            return self._distance(tried) < self._distance(self.best) * (1.0 - CLOSED)

        here = self._demands(self.best)
        for _ in range(ROUNDS):
            found = self._halved(self._step(here), 0.0, here, is_nearer)
            if found is None:
                break
            self.best, here = found
        self.amiss = here.amiss

    def _halved(
        self,
        step: Reals,
        beyond: float,
        here: _Demands,
        is_better: Callable[[Reals, _Demands, _Demands], bool],
    ) -> tuple[Reals, _Demands] | None:
        """The places after a step, or after the first half of it, and so on, that is better, and what is
        asked there."""
        for _ in range(HALVINGS):
            tried = self._after(step)
            there = self._demands(tried, beyond)
            if is_better(tried, there, here):
                return tried, there
            step = 0.5 * step
        return None

    def _step(self, here: _Demands, least: bool = False, firm: float = 1.0) -> Reals:
        gone = self._gone(self.best) if not least else np.zeros(self.model.nv)
        metric = self._metric(self.best)
        metric[self.turns, self.turns] *= firm
        step = _nearest(metric, here, gone)
        pace = float(np.abs(step * self.lever).max(initial=0.0))
        return step * (min(1.0, FAR * self.size / pace) if pace > 0.0 else 0.0)

    def _after(self, step: Reals) -> Reals:
        tried = self.best.copy()
        self.mujoco.mj_integratePos(self.model, tried, step, 1.0)
        return tried

    def _gone(self, q: Reals) -> Reals:
        gone = np.zeros(self.model.nv)
        self.mujoco.mj_differentiatePos(self.model, gone, 1.0, self.start, q)
        return gone

    def _distance(self, q: Reals) -> float:
        gone = self._gone(q)
        return float(np.sqrt(gone @ self._metric(q) @ gone))

    def result(self) -> Settled:
        """The best places that were seen."""
        moved = np.linalg.norm(self._geoms(self.best) - self.first, axis=1)
        far = int(moved.argmax()) if len(moved) else 0
        geom = int(self.moving[far]) if len(moved) else -1
        pairs = self._overlapping(self.best)
        return Settled(self.best, self.amiss, pairs, float(moved.max(initial=0.0)), self.size, geom)

    def _overlapping(self, q: Reals) -> tuple[tuple[int, int], ...]:
        """Bodies that overlap by more than rounding, the deepest first."""
        self.data.qpos[:] = q
        self.mujoco.mj_fwdPosition(self.model, self.data)
        contact, body = self.data.contact, self.model.geom_bodyid
        overlaps = (contact.efc_address >= 0) & (contact.dist < -ROUNDED * self.size)
        deep = np.flatnonzero(overlaps)[np.argsort(contact.dist[overlaps])]
        pairs = [tuple(sorted(body[contact.geom[each]].tolist())) for each in deep]
        return tuple(dict.fromkeys((one, other) for one, other in pairs))

    def _geoms(self, q: Reals) -> Reals:
        """Places (g, 3) of geoms that move."""
        self.data.qpos[:] = q
        self.mujoco.mj_kinematics(self.model, self.data)
        return np.array(self.data.geom_xpos[self.moving])

    def _size(self) -> float:
        """The longest side of a box around all geoms that move."""
        reach = self.model.geom_rbound[self.moving][:, None]
        if not len(reach):
            return float(self.model.stat.extent)
        return float(((self.first + reach).max(axis=0) - (self.first - reach).min(axis=0)).max())

    def _levers(self) -> Reals:
        """The length that a unit of each velocity moves something by: 1 along, the size about an axis."""
        m, lever = self.model, np.ones(self.model.nv)
        for joint in range(m.njnt):
            at, kind = int(m.jnt_dofadr[joint]), int(m.jnt_type[joint])
            free, ball, slide = 0, 1, 2
            turning = {free: slice(at + 3, at + 6), ball: slice(at, at + 3)}.get(kind, slice(at, at + 1))
            if kind != slide:
                lever[turning] = self.size
        return lever

    def _captured(self) -> NDArray[np.bool_]:
        """Which equalities hold a body to one that motion capture leads; one entry where there are none."""
        m, body = self.model, int(self.mujoco.mjtObj.mjOBJ_BODY)
        if not m.neq:
            return np.zeros(1, bool)
        of_bodies = m.eq_objtype == body
        sides = [m.body_mocapid[np.where(of_bodies, side, 0)] >= 0 for side in (m.eq_obj1id, m.eq_obj2id)]
        return np.asarray(of_bodies & (sides[0] | sides[1]))

    def _metric(self, q: Reals) -> Reals:
        """M (n, n) of bodies of mass 1."""
        mujoco, m, d = self.mujoco, self.unit, self.unit_data
        d.qpos[:] = q
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        mujoco.mj_makeM(m, d)
        metric = np.zeros((m.nv, m.nv))
        mujoco.mj_fullM(m, d, metric)
        return metric

    def _demands(self, q: Reals, beyond: float = 0.0) -> _Demands:
        """What is asked of a step from q (n_q,)."""
        rows, off, equal, contact = self._constraints(q)
        reach = np.abs(rows * self.lever).max(axis=1, initial=0.0)
        unit = np.where(contact | (reach == 0.0), 1.0, self.size / np.where(reach > 0.0, reach, 1.0))
        rows, off = rows * unit[:, None], off * unit
        wrong = np.where(equal, np.abs(off), np.maximum(-off, 0.0))
        overlaps = contact & (off < -CLOSED * self.size)
        clear = np.where(overlaps, CLEAR * self.size + beyond * np.maximum(-off, 0.0), 0.0)
        return _Demands(rows, clear - off, equal, float(wrong.max(initial=0.0)), float(wrong @ wrong))

    def _constraints(self, q: Reals) -> tuple[Reals, Reals, NDArray[np.bool_], NDArray[np.bool_]]:
        """Rows (k, n) at q (n_q,), what each is off (k,), and which are equalities and contacts (k,). Nearest
        points are contacts besides where MuJoCo's contacts of faces miss them."""
        rows, off, equal, contact = self._found(q)
        if not self.is_faced:
            return rows, off, equal, contact
        flags, geoms = self.model.opt.disableflags, self.data.contact.geom[self._met()].tolist()
        least = dict[tuple[int, int], float]()
        for pair, gap in zip(map(tuple, geoms), off[contact].tolist(), strict=True):
            least[pair] = min(gap, least.get(pair, np.inf))
        self.model.opt.disableflags = flags | self.mujoco.mjtDisableBit.mjDSBL_MULTICCD
        near_rows, near, _, also = self._found(q)
        self.model.opt.disableflags = flags
        nearest = map(tuple, self.data.contact.geom[self._met()].tolist())
        missed = [
            k for k, pair in zip(np.flatnonzero(also), nearest, strict=True)
            if near[k] < least.get(pair, np.inf) - ROUNDED * self.size
        ]  # fmt: skip
        more = np.ones(len(missed), bool)
        return (
            np.concatenate([rows, near_rows[missed]]), np.concatenate([off, near[missed]]),
            np.concatenate([equal, ~more]), np.concatenate([contact, more]),
        )  # fmt: skip

    def _met(self) -> NDArray[np.intp]:
        """The contacts in the data that have rows."""
        return np.flatnonzero(self.data.contact.efc_address >= 0)

    def _found(self, q: Reals) -> tuple[Reals, Reals, NDArray[np.bool_], NDArray[np.bool_]]:
        """The constraints (see `_constraints`) that MuJoCo finds: contacts come last."""
        mujoco, m, d, kinds = self.mujoco, self.model, self.data, self.mujoco.mjtConstraint
        d.qpos[:] = q
        mujoco.mj_fwdPosition(m, d)
        every = np.array(d.efc_J).reshape(-1, m.nv)[: d.nefc]
        kind, place = np.array(d.efc_type[: d.nefc]), np.array(d.efc_pos[: d.nefc])
        equal = kind == kinds.mjCNSTR_EQUALITY
        limit = (kind == kinds.mjCNSTR_LIMIT_JOINT) | (kind == kinds.mjCNSTR_LIMIT_TENDON)
        met = self._met()
        first = d.contact.efc_address[met]
        meshes = (m.geom_type[d.contact.geom[met]] == mujoco.mjtGeom.mjGEOM_MESH).any(axis=1)
        place[first] = d.contact.dist[met] - self.rough * meshes
        led = equal & self.captured[np.where(equal, d.efc_id[: d.nefc], 0)]
        kept = np.concatenate([np.flatnonzero((equal & ~led) | limit), first]).astype(int)
        return every[kept], place[kept], equal[kept], np.isin(kept, first)


class _Demands(NamedTuple):
    """Rows (k, n), lengths, and what each at least has to change by (k,), or just where `equal` (k,); how far
    the worst of them is off, and the sum of all squared."""

    rows: Reals
    least: Reals
    equal: NDArray[np.bool_]
    amiss: float
    sum: float


def _nearest(metric: Reals, demands: _Demands, gone: Reals) -> Reals:
    """The step d (n,) with the least |d + gone| in the metric that meets the demands, as far as can be."""
    from scipy.linalg import solve_triangular  # takes half a second, and few scenes settle
    from scipy.optimize import nnls

    rows, least, equal = demands[:3]
    root = np.linalg.cholesky(metric + 1e-12 * np.trace(metric) / len(metric) * np.eye(len(metric)))
    rows, least = np.vstack([rows, -rows[equal]]), np.concatenate([least, -least[equal]])
    asked = least + rows @ gone
    scale = float(np.abs(asked).max(initial=0.0))
    if scale == 0.0:
        return -gone
    in_units = solve_triangular(root, rows.T, lower=True)
    system = np.vstack([in_units, YIELD * np.eye(len(asked)), asked / scale])
    right = np.zeros(len(system))
    right[-1] = 1.0
    multipliers, _ = nnls(system, right, maxiter=20 * system.shape[1] + 100)
    left = system @ multipliers - right
    moved = -left[: len(metric)] / left[-1] * scale
    return np.asarray(solve_triangular(root, moved, lower=True, trans="T") - gone)
