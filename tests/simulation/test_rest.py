"""Bodies that are wedged exactly rest if and only if a linear program finds forces that balance.

Where they may rest, falling solves the step of the limit as well, without end or to a floor below: Pang and
Trinkle, ZAMM 80 (2000) 643-663.
"""

from __future__ import annotations

import math
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import rungwise as rw
from rungwise.contact.judge.certificate import check, without_inertia
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.simulation.planar.state.nearby import gather, widen
from rungwise.simulation.run import Simulation
from rungwise.system.planar import terms as planar
from tests.simulation.linear_system import linear_system

Body = dict[str, Any]


class Wedge:
    """A random scene; `size` is its unit of length, `turn` the angle of its frame."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.size, self.turn = 10 ** self.rng.uniform(-3, 3), self.rng.uniform(0, 2 * math.pi)
        self.friction, self.low = self.rng.uniform(0, 2), math.inf
        self.bodies: dict[str, Body] = {}
        heading = -math.pi / 2 if self.rng.random() < 0.6 else self.rng.uniform(0, 2 * math.pi)
        self.gravity = self.turned(9.81 * math.cos(heading), 9.81 * math.sin(heading))
        [self.books, self.vee, self.slot, self.discs][seed % 4]()
        if self.rng.random() < 0.5:
            self.add("floor", {"kind": "halfplane"}, 0.0, self.low - 10 ** self.rng.uniform(-6, 1))

    def turned(self, x: float, y: float) -> list[float]:
        c, s = math.cos(self.turn), math.sin(self.turn)
        return [c * x - s * y, s * x + c * y]

    def add(self, name: str, shape: Body, x: float = 0.0, y: float = 0.0) -> None:
        if shape["kind"] == "halfplane":
            shape["normal"] = self.turned(*shape.get("normal", (0.0, 1.0)))
        if name.startswith("part"):
            self.low = min(self.low, y - shape.get("radius", 0.5 * shape.get("height", 0.0)))
        x, y = (self.size * each for each in self.turned(x, y))
        body: Body = {"role": "obstacle", "shape": shape, "pose": {"x": x, "y": y}}
        if shape["kind"] != "halfplane":
            body["pose"]["angle"] = self.turn
            shape |= {key: self.size * value for key, value in shape.items() if isinstance(value, float)}
        if name.startswith("part"):
            body |= {"role": "object", "motion": {"kind": "free"}, "mass": self.rng.uniform(0.1, 3)}
        self.bodies[name] = body

    def box(self, name: str, width: float, height: float, x: float = 0.0, y: float = 0.0) -> None:
        self.add(name, {"kind": "box", "width": width, "height": height}, x, y)

    def books(self) -> None:
        """One to three books exactly between two bookends."""
        count, width, height = (
            int(self.rng.integers(1, 4)),
            self.rng.uniform(0.1, 1),
            self.rng.uniform(0.3, 3),
        )
        for i in range(count):
            self.box(f"part{i}", width, height * self.rng.uniform(0.7, 1), width * (i + 0.5))
        self.box("left", 0.5, 3 * height, -0.25)
        self.box("right", 0.5, 3 * height, count * width + 0.25)

    def vee(self) -> None:
        """A disc or a box in a V."""
        half, size = self.rng.uniform(0.1, 1.3), self.rng.uniform(0.2, 1)
        self._walls(half)
        if self.rng.random() < 0.5:
            self.add("part0", {"kind": "disc", "radius": size}, 0.0, size / math.sin(half))
        else:
            height = size * self.rng.uniform(0.1, 0.9)
            self.box("part0", size, height, 0.0, 0.5 * (size / math.tan(half) + height))

    def slot(self) -> None:
        """Pegs in a slot as wide as they are, one on the other or apart."""
        length, y = self.rng.uniform(0.5, 2), 0.0
        for i in range(int(self.rng.integers(1, 4))):
            self.box(f"part{i}", 1.0, length, 0.0, y)
            y += length * (1.0 if self.rng.random() < 0.7 else 1.3)
        self.box("left", 0.5, 9 * length, -0.75)
        self.box("right", 0.5, 9 * length, 0.75)

    def discs(self) -> None:
        """A disc in a V, and one that leans on it and on one side."""
        half, radius = self.rng.uniform(0.3, 1.0), self.rng.uniform(0.7, 1.4)
        self._walls(half)
        self.add("part0", {"kind": "disc", "radius": 1.0}, 0.0, 1.0 / math.sin(half))
        # Along the side from the apex: where the discs touch.
        along = 1.0 / math.tan(half) + math.sqrt((1.0 + radius) ** 2 - (1.0 - radius) ** 2)
        x = radius * math.cos(half) - along * math.sin(half)
        y = radius * math.sin(half) + along * math.cos(half)
        self.add("part1", {"kind": "disc", "radius": radius}, x, y)

    def _walls(self, half: float) -> None:
        for name, side in (("left", 1.0), ("right", -1.0)):
            self.add(name, {"kind": "halfplane", "normal": [side * math.cos(half), math.sin(half)]})

    def scene(self) -> rw.Scene:
        law = {"friction": self.friction, "stiffness": 1e6, "damping": 1e3}
        parts = [name for name in self.bodies if name.startswith("part")]
        pairs = [[part, other] for part in parts for other in self.bodies if other not in parts]
        pairs += [list(pair) for pair in pairwise(parts)]
        return rw.load(
            {
                "name": "wedge", "gravity": self.gravity, "bodies": self.bodies,
                "contacts": [{"between": pair, **law} for pair in pairs],
                "tolerance": 1e-6 * self.size, "duration": 0.02, "step": 1e-3,
            }
        )  # fmt: skip


def balances(scene: rw.Scene) -> bool:
    """Whether forces in the cones of the contacts that are closed at the start balance the loads."""
    run = Simulation(scene, rw.QUASISTATIC_RIGID, frames=3)
    workspace, records = run.workspace, run._bound.records
    assert workspace is not None
    state, terms = workspace.state, workspace.terms
    planar.loads(
        records, state.placed.pose, state.q, state.v, state.start, 0.0, 1.0, 1.0, state.passive, terms
    )
    widen(records, workspace, 0.0)
    closed = np.flatnonzero(terms.gap[: gather(records, workspace)] <= terms.rounding[0])
    edges = [
        terms.rows[2 * k] + side * terms.friction[k] * terms.rows[2 * k + 1]
        for k in closed
        for side in (-1, 1)
    ]
    heaviest = np.abs(terms.load).max()
    found = linprog(np.zeros(len(edges)), A_eq=np.transpose(edges), b_eq=-terms.load / heaviest)
    return bool(found.status == 0)


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [None, 1e-3])
def test_what_may_rest_rests_and_nothing_else(tol: float | None) -> None:
    rests = 0
    for seed in range(48):
        wedge = Wedge(seed)
        scene = wedge.scene()
        run = rw.simulate(scene, rw.QUASISTATIC_RIGID, tol=tol and tol * wedge.size, frames=3)
        if balances(scene):
            rests += 1
            places = run.trajectory["position"].to_numpy()
            assert run.outcome == "timeout", (seed, run.reason)
            assert np.abs(places[-1] - places[0]).max() <= 1e-9 * wedge.size, seed
        else:
            assert run.outcome == "unsupported", (seed, run.reason)
    assert 24 <= rests <= 47


def _excluded_by_every_mode(run: rw.Run, resisting: np.ndarray[Any, Any]) -> bool:
    """Whether each mode of all contacts misses its equations and inequalities by more than rounding."""
    assert run.problem is not None
    limit = without_inertia(run.problem, resisting)
    for mode in product((OPEN, STICK, FORWARD, BACKWARD), repeat=len(limit.mu)):
        equal, value, least, bound = linear_system(limit, mode)
        rows = np.vstack([equal, -equal, -least])
        found = linprog(
            np.append(np.zeros(equal.shape[1]), 1.0), np.hstack([rows, np.full((len(rows), 1), -1.0)]),
            np.concatenate([value, -value, -bound]), bounds=[(-1e3, 1e3)] * equal.shape[1] + [(0.0, None)],
        )  # fmt: skip
        if found.status == 0 and found.fun < 1e-7:
            return False
    return True


@pytest.mark.long
@pytest.mark.parametrize("count", [14, pytest.param(40, marks=pytest.mark.long)])
def test_exact_fits_on_compliant_contacts_rest_or_have_a_proof(count: int) -> None:
    """Compliant contacts press only as far as they yield: a body that fits exactly between others is in
    balance only where a tilt presses it against both sides."""
    outcomes, compared = {"timeout": 0, "unsupported": 0, "not_converged": 0}, 0
    for seed in range(3, 3 + count):
        run = Simulation(Wedge(seed).scene(), rw.QUASISTATIC_COMPLIANT, frames=3)
        while run.advance():
            pass
        found = run.result()
        outcomes[str(found.outcome)] += 1
        if found.outcome == "unsupported":
            resisting = run._reasons().resisting()
            assert found.certificate is not None and found.problem is not None
            assert check(found.problem, found.certificate, resisting), seed
            if found.certificate.kind == "unbalanced" and len(found.problem.mu) <= 4:
                compared += 1
                assert _excluded_by_every_mode(found, resisting), seed
        elif seed == 40:  # the loop alone finds the fall, not the balance
            assert found.outcome == "timeout", found.reason
    assert (
        compared >= count / 20
        and outcomes["timeout"] >= 3 * count / 8
        and outcomes["unsupported"] >= count / 4
    )
    assert outcomes["not_converged"] == 0


def test_a_book_that_rests_says_that_it_may_fall_as_well() -> None:
    """Between bookends just as far apart as it is wide a book rests on two supports that nothing calls for;
    on a floor it rests on one, and cannot fall."""
    end = {"role": "obstacle", "shape": {"kind": "box", "width": 1.0, "height": 6.0}}
    book = {
        "role": "object", "motion": {"kind": "free"}, "mass": 1.0,
        "shape": {"kind": "box", "width": 1.0, "height": 2.0},
    }  # fmt: skip
    bodies = {"book": book, "left": end | {"pose": {"x": -1.0}}, "right": end | {"pose": {"x": 1.0}}}
    scene = {
        "name": "book", "gravity": [0, -9.81], "bodies": bodies, "duration": 0.01,
        "contacts": [{"between": ["book", "*"], "friction": 0.3}],
    }  # fmt: skip
    (note,) = rw.simulate(scene, rw.QUASISTATIC_RIGID).notes
    assert note.startswith("rest: at t = 0 the run keeps bodies at rest by friction")
    assert "book.y -1 (" in note
    bodies["floor"] = {"role": "obstacle", "shape": {"kind": "halfplane"}, "pose": {"y": -1.0}}
    assert rw.simulate(scene, rw.QUASISTATIC_RIGID).notes == ()
