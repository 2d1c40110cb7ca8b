"""Steps of scenes in space: what the contact solver takes for the contact problems of MuJoCo's scenes.

    python benchmarks/spatial_steps.py [--scene NAME …] [--steps N] [--h H …] [--save FOLDER]

MuJoCo supplies inertia, loads and the geometry of contacts; a problem per step is assembled in numpy, with
the forces of the last step as a start, and solved to a residual of 1e-8. A step without solution is halved,
up to four times. Each scene runs with rigid contacts and with compliant ones (K = 1e6, C = 2e3).

  us        microseconds per solve: median, mean and 99th percentile, and the median of the last quarter
  solves/s  one over the mean
  within    share of solves whose residual is within 1e-8; of steps, halves included, that were solved at all
  idle      share of solves that the forces of the last step solved
  contacts  mean and most of a solve
  mj_step   microseconds of MuJoCo's own step of the same scene and step length: median, from the same start
            (elliptic cones, Newton, tolerance 1e-8, 100 iterations; it includes collision and kinematics)

The hand is gymnasium_robotics' Shadow hand with a block, and is left out where that package is missing.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import pickle
import time
from dataclasses import dataclass, field
from pathlib import Path

import mujoco as mj
import numpy as np
from numpy.typing import NDArray

from rungwise.contact.kinds.cone import KIND as CONE
from rungwise.contact.solver.step import solve_groups
from rungwise.contact.step import NO_SURFACES, SOLVED, ContactProblem, Sizes, Unknowns
from rungwise.contact.step.problem import allocate_problem
from rungwise.kernel import linking_time

Array = NDArray[np.float64]
STIFFNESS, DAMPING = 1e6, 2e3
EVERYWHERE = np.empty((0, 4), np.int64)
"""Rows may have entries in any column."""
MATCH = 1e-2
"""Metres by which a contact may move on a body from one step to the next."""
ROUNDING = 1e-12
"""Metres within which a gap is closed, and beyond which overlaps of rigid bodies are halved each step."""
HALVINGS = 4
BIN = """<geom type="plane" size="5 5 1"/>
<geom type="box" size=".05 .6 .5" pos="-.5 0 .5"/><geom type="box" size=".05 .6 .5" pos=".5 0 .5"/>
<geom type="box" size=".6 .05 .5" pos="0 -.5 .5"/><geom type="box" size=".6 .05 .5" pos="0 .5 .5"/>"""


def scene(bodies: str, ground: str, mu: float, torsion: float = 0.0) -> mj.MjModel:
    dim = 4 if torsion else 3
    return mj.MjModel.from_xml_string(
        f'<mujoco><default><geom friction="{mu} {torsion} 0" condim="{dim}" density="500"/></default>'
        f"<worldbody>{ground}{bodies}</worldbody></mujoco>"
    )


def free(shape: str, place: Array, turn: Array | None = None) -> str:
    at = " ".join(map(str, place))
    turned = "" if turn is None else f'euler="{" ".join(map(str, turn))}"'
    return f'<body pos="{at}" {turned}><freejoint/><geom {shape}/></body>'


def stack() -> mj.MjModel:
    boxes = "".join(free('type="box" size=".1 .1 .1"', np.array([0, 0, 0.1 + 0.2005 * i])) for i in range(10))
    return scene(boxes, '<geom type="plane" size="5 5 1"/>', 0.5)


def pile(seed: int = 0, torsion: float = 0.0) -> mj.MjModel:
    rng, bodies = np.random.default_rng(seed), ""
    shapes = ('type="box" size=".12 .1 .08"', 'type="sphere" size=".1"', 'type="capsule" size=".07 .1"')
    for i in range(20):
        place = np.array([*rng.uniform(-0.25, 0.25, 2), 0.2 + 0.16 * i])
        bodies += free(shapes[i % 3], place, rng.uniform(-180, 180, 3))
    return scene(bodies, BIN, 0.5, torsion)


def hand() -> mj.MjModel | None:
    package = importlib.util.find_spec("gymnasium_robotics")
    if package is None or package.origin is None:
        return None
    path = Path(package.origin).parent / "envs/assets/hand/manipulate_block.xml"
    spec = mj.MjSpec.from_file(str(path))
    for body in spec.bodies:
        if body.name in ("target", "object_hidden"):
            spec.delete(body)
    return spec.compile()


SCENES = {"stack": stack, "pile": pile, "torsion": lambda: pile(1, 0.02), "hand": hand}


@dataclass
class Tally:
    seconds: list[float] = field(default_factory=list)
    residuals: list[float] = field(default_factory=list)
    contacts: list[int] = field(default_factory=list)
    stages: list[int] = field(default_factory=list)
    hard: list[tuple[object, ...]] = field(default_factory=list)
    steps: int = 0
    lost: int = 0


@dataclass
class Space:
    """One run of a model of MuJoCo with forces from the contact solver."""

    model: mj.MjModel
    compliant: bool
    quasistatic: bool = False
    keep: int = 0

    def __post_init__(self) -> None:
        m = self.model
        m.opt.cone, m.opt.jacobian = mj.mjtCone.mjCONE_ELLIPTIC, mj.mjtJacobian.mjJAC_DENSE
        m.geom_margin[:] = 0.01
        self.data, self.tally = mj.MjData(m), Tally()
        self.d = 4 if (m.geom_condim[m.geom_contype > 0] == 4).any() else 3
        self.memory: list[tuple[tuple[int, ...], Array, Array, Array]] = []
        self.mass = np.zeros((m.nv, m.nv))
        self.tau = np.zeros(0)
        self.servo = np.array([b[1] < 0.0 for b in m.actuator_biasprm], bool).reshape(m.nu)

    def step(self, h: float) -> None:
        self.tally.steps += 1
        if not self._advance(h, HALVINGS):
            self.tally.lost += 1

    def _advance(self, h: float, halvings: int) -> bool:
        if self._try(h):
            return True
        return halvings > 0 and self._advance(h / 2, halvings - 1) and self._advance(h / 2, halvings - 1)

    def _try(self, h: float) -> bool:
        m, d, x = self.model, self.data, self.d
        before = d.qvel.copy()
        if self.quasistatic:
            d.qvel[:] = 0.0
        mj.mj_fwdPosition(m, d)
        mj.mj_fwdVelocity(m, d)
        mj.mj_fwdActuation(m, d)
        mj.mj_fullM(m, d, self.mass)
        rows, kind = d.efc_J.reshape(d.nefc, m.nv), d.efc_type
        touching, limits = (
            np.flatnonzero(d.contact.efc_address >= 0),
            np.flatnonzero((kind == 3) | (kind == 4)),
        )
        forced = np.flatnonzero(kind <= 2)
        k, servos = len(touching) + len(limits), int(self.servo.sum())
        p = allocate_problem(m.nv, k, len(forced) + servos, x)
        inertia = 1e-6 if self.quasistatic else 1.0
        p.H[:] = inertia * self.mass / h + np.diag(m.dof_damping)
        load = d.qfrc_passive + m.dof_damping * d.qvel - d.qfrc_bias
        p.c[:] = self.mass @ d.qvel / h * (not self.quasistatic) + load
        p.quantum[0] = ROUNDING / h
        force, slip, keys = np.zeros((k, x)), np.zeros((k, x)), []
        used: set[int] = set()
        for i, c in enumerate(touching):
            at, dim = d.contact.efc_address[c], min(d.contact.dim[c], x)
            p.W[x * i : x * i + dim], p.mu[i] = rows[at : at + dim], d.contact.friction[c, 0] * (dim > 1)
            if dim == 4:
                p.W[x * i + 3] *= d.contact.friction[c, 2] / d.contact.friction[c, 0]
            key, local = self._place(c)
            keys.append((key, local))
            old = self._find(key, local, used)
            frame = d.contact.frame[c].reshape(3, 3)
            if old is not None:
                force[i], slip[i] = _turned(frame, old[2]), _turned(frame, old[3])
            gap = d.contact.dist[c]
            p.w[x * i] = gap / h
            if self.compliant:
                give = 1.0 / (h * STIFFNESS + DAMPING)
                p.R[i] = give * np.eye(x)
                p.w[x * i : x * i + x] = -give * STIFFNESS * slip[i]
                p.w[x * i] = (gap + give * DAMPING * slip[i, 0]) / h
            else:
                p.w[x * i] *= 0.0 if abs(gap) < ROUNDING else 0.5 if gap < 0.0 else 1.0
        for i, r in enumerate(limits, len(touching)):
            p.W[x * i], p.w[x * i] = rows[r], max(d.efc_pos[r], 0.0) / h
        p.S[: len(forced)], p.F[: len(forced)] = rows[forced], np.where(
            kind[forced] == 0, np.inf, d.efc_frictionloss[forced]
        )  # fmt: skip
        p.w_s[: len(forced)] = np.where(kind[forced] == 0, d.efc_pos[forced] / h, 0.0)
        if m.nu:
            self._add_servos(p, len(forced), h)
        modes, v = np.zeros(k + len(p.F), np.int64), np.zeros(m.nv)
        flat = force.ravel()
        tau = self.tau.copy() if len(self.tau) == len(p.F) else np.zeros(len(p.F))
        start = flat.copy(), tau.copy()
        began = time.perf_counter() - linking_time()
        status, found, stage, _ = solve_groups(
            p,
            Sizes(m.nv, k, len(p.F)),
            Unknowns(modes, v, flat, tau),
            CONE,
            NO_SURFACES,
            EVERYWHERE,
            EVERYWHERE,
            np.zeros(1, np.int64),
        )
        t = self.tally
        t.seconds.append(time.perf_counter() - linking_time() - began)
        t.residuals.append(found)
        t.contacts.append(k)
        t.stages.append(stage)
        if self.keep and (stage > 1 or len(t.seconds) % self.keep == 0):
            t.hard.append((len(t.seconds), status, found, vars_of(p), start))
        if status != SOLVED:
            d.qvel[:] = before
            return False
        force = flat.reshape(k, x)
        self.tau = tau
        self.memory = []
        for i, (c, (key, local)) in enumerate(zip(touching, keys, strict=True)):
            frame = d.contact.frame[c].reshape(3, 3)
            bend = slip[i]
            if self.compliant:
                bend = (h * force[i] + DAMPING * slip[i]) / (h * STIFFNESS + DAMPING)
            self.memory.append((key, local, _turned(frame.T, force[i]), _turned(frame.T, bend)))
        d.qvel[:] = v
        mj.mj_integratePos(m, d.qpos, d.qvel, h)
        d.time += h
        return True

    def _add_servos(self, p: ContactProblem, at: int, h: float) -> None:
        """Servos hold with K_p (q_d - q) at the step's end; other actuators are loads."""
        m, d, servo = self.model, self.data, self.servo
        moment = np.zeros((m.nu, m.nv))
        mj.mju_sparse2dense(moment, d.actuator_moment, d.moment_rownnz, d.moment_rowadr, d.moment_colind)
        p.c[:] += moment[~servo].T @ d.actuator_force[~servo]
        gain, bias = m.actuator_gainprm[servo, 0], m.actuator_biasprm[servo]
        give = 1.0 / (-h * bias[:, 1] - bias[:, 2])
        p.S[at:], p.R_s[at:] = moment[servo], give
        p.w_s[at:] = -give * (gain * d.ctrl[servo] + bias[:, 0] + bias[:, 1] * d.actuator_length[servo])
        limit = np.abs(m.actuator_forcerange[servo]).max(axis=1)
        p.F[at:] = np.where(m.actuator_forcelimited[servo].astype(bool), limit, np.inf)

    def _place(self, c: int) -> tuple[tuple[int, ...], Array]:
        pair = tuple(int(g) for g in self.data.contact.geom[c])
        turned = self.data.geom_xmat[pair[0]].reshape(3, 3)
        return pair, turned.T @ (self.data.contact.pos[c] - self.data.geom_xpos[pair[0]])

    def _find(
        self, key: tuple[int, ...], local: Array, used: set[int]
    ) -> tuple[tuple[int, ...], Array, Array, Array] | None:
        best, least = -1, MATCH
        for j, old in enumerate(self.memory):
            if old[0] == key and j not in used and np.abs(old[1] - local).max() < least:
                best, least = j, float(np.abs(old[1] - local).max())
        used.add(best)
        return self.memory[best] if best >= 0 else None


def vars_of(p: ContactProblem) -> dict[str, Array]:
    return {name: getattr(p, name).copy() for name in ContactProblem.__annotations__}


def _turned(frame: Array, vector: Array) -> Array:
    """The first three entries, in the frame; a torsion is the same in each."""
    return np.concatenate([frame @ vector[:3], vector[3:]])


def own_step(model: mj.MjModel, h: float, steps: int) -> float:
    """Median seconds of MuJoCo's step."""
    model.opt.timestep, model.opt.solver = h, mj.mjtSolver.mjSOL_NEWTON
    model.opt.tolerance, model.opt.iterations = 1e-8, 100
    model.geom_margin[:] = 0.0
    data, seconds = mj.MjData(model), []
    for _ in range(steps):
        began = time.perf_counter()
        mj.mj_step(model, data)
        seconds.append(time.perf_counter() - began)
    return float(np.median(seconds))


def run(
    name: str, model: mj.MjModel, h: float, steps: int, compliant: bool, quasistatic: bool = False
) -> Space:
    space = Space(model, compliant, quasistatic, keep=50)
    if name == "hand":  # the block falls on the palm, and the fingers close around it
        _grasp(space, 0.8)
        space.quasistatic = False
        for _ in range(500):
            space.step(2e-3)
        space.quasistatic, space.tally = quasistatic, Tally()
    for i in range(steps):
        if name == "hand":
            _grasp(space, 0.8 + 0.1 * math.sin(4.0 * i * h))
        space.step(h)
    t, us = space.tally, 1e6 * np.array(space.tally.seconds)
    within = np.mean(np.array(t.residuals) <= 1e-8)
    rung = ("quasistatic" if quasistatic else "dynamic") + ("-compliant" if compliant else "-rigid")
    print(
        f"{name:8s}{rung:22s} h={h:.0e} us {np.median(us):6.0f} {us.mean():6.0f} {np.quantile(us, 0.99):7.0f}"
        f" last {np.median(us[-len(us) // 4 :]):6.0f} solves/s {1e6 / us.mean():6.0f} within {within:.4f}"
        f" steps {1.0 - t.lost / t.steps:.4f} idle {np.mean(np.array(t.stages) == 0):.2f}"
        f" contacts {np.mean(t.contacts):.0f} {max(t.contacts)}",
        flush=True,
    )
    return space


def _grasp(space: Space, closed: float) -> None:
    """Aim the fingers' servos at this part of their ranges; the wrist stays in the middle."""
    m = space.model
    low, high = m.actuator_ctrlrange.T
    names = [mj.mj_id2name(m, mj.mjtObj.mjOBJ_ACTUATOR, i) or "" for i in range(m.nu)]
    part = [closed if name.endswith(("FJ2", "FJ1", "THJ1", "THJ0")) else 0.5 for name in names]
    space.data.ctrl[:] = low + np.array(part) * (high - low)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--h", nargs="+", type=float, default=[2e-3])
    parser.add_argument("--save", type=Path, help="folder for every fiftieth problem and the unsolved")
    wanted = parser.parse_args()
    Space(stack(), False).step(1e-3)  # compiles
    for name in wanted.scene:
        for h in wanted.h:
            for quasistatic in (False, True) if name == "hand" else (False,):
                for compliant in (False, True):
                    model = SCENES[name]()
                    if model is None:
                        continue
                    space = run(name, model, h, wanted.steps, compliant, quasistatic)
                    if wanted.save:
                        wanted.save.mkdir(exist_ok=True)
                        path = wanted.save / f"{name}{'-q' * quasistatic}-{'c' * compliant}-{h:.0e}.pkl"
                        path.write_bytes(pickle.dumps(space.tally.hard))
            model = SCENES[name]()
            if model is not None:
                print(
                    f"{name:8s}mj_step h={h:.0e} us {1e6 * own_step(model, h, wanted.steps):.0f}", flush=True
                )


if __name__ == "__main__":
    main()
