"""Piles of many bodies: steps solved by their few entries, as by the chain of few bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.solver.residual import residual_of_rows
from rungwise.contact.step import (
    NO_SURFACES,
    SOLVED,
    TOLERANCE,
    ContactProblem,
    Elimination,
    Sizes,
    Unknowns,
    matrix_size,
)
from rungwise.kernel import Ints
from rungwise.models.entries import trimmed
from rungwise.simulation.run import Simulation
from rungwise.system.entries import CROWDED
from tests.contact.kept import kept

from .test_stacks import box, on_ground, pyramid

Spans: TypeAlias = tuple[Ints, Ints]
DYNAMIC = [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT]


def heap(count: int, seed: int) -> list[dict[str, Any]]:
    """Boxes that fall on each other: turned at random, in columns side by side."""
    rng = np.random.default_rng(seed)
    bodies = []
    for i in range(count):
        row, column = divmod(i, 5)
        x, y = 1.7 * column + rng.uniform(-0.15, 0.15), 0.75 + 1.45 * row
        bodies.append(box(x, y, 0.9, rng.uniform(-3.0, 3.0)))
    return bodies


def triangles(count: int, seed: int) -> list[dict[str, Any]]:
    """Triangles of very unequal mass, turned at random, in columns side by side."""
    rng = np.random.default_rng(seed)
    shape = {"kind": "polygon", "vertices": [[-0.45, -0.3], [0.45, -0.3], [0.0, 0.5]]}
    bodies = []
    for i in range(count):
        row, column = divmod(i, 5)
        x, y = 1.2 * column + rng.uniform(-0.1, 0.1), 0.6 + 1.1 * row
        mass = 10.0 ** rng.uniform(-1.5, 1.5)
        bodies.append(box(x, y, 0.9, rng.uniform(-3.0, 3.0)) | {"shape": shape, "mass": mass})
    return bodies


def problem_of(
    model: rw.Rung, bodies: list[dict[str, Any]], steps: int
) -> tuple[ContactProblem, Unknowns, Spans]:
    """A step's problem on the way of a run, the answer of the run to it, and where it has entries."""
    run = Simulation(on_ground(bodies, duration=10.0, step=2e-3), model)
    run.advance(steps)
    assert run.workspace is not None
    clock, scratch = run.workspace.state.clock[0], run.workspace.scratch
    n, k, b = int(clock["free"]), int(clock["contacts"]), int(clock["limited"])
    answer = Unknowns(
        scratch.mode[: k + b].copy(), scratch.x[:n].copy(), scratch.contact_force[: 2 * k].copy(),
        scratch.limited_force[:b].copy(),
    )  # fmt: skip
    entries = run.workspace.terms.entries
    full = np.tile(np.array([0, n, n, n]), (k, 1)), np.tile(np.array([0, n]), (n, 1))
    spans = (entries.columns[:k].copy(), entries.couplings.copy()) if n >= CROWDED else full
    return trimmed(run.workspace.problem, run.workspace.terms, n, k, b), answer, spans


def sizes_of(p: ContactProblem) -> Sizes:
    return Sizes(len(p.c), len(p.mu), len(p.F))


def solved(
    p: ContactProblem, spans: Spans | None, start: Unknowns | None = None
) -> tuple[int, float, Unknowns]:
    n, k, b = sizes_of(p)
    size = matrix_size(n, k, b)
    room = Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))
    found = Unknowns(np.zeros(k + b, np.int64), np.zeros(n), np.zeros(2 * k), np.zeros(b))
    if start is not None:
        found = Unknowns(*(part.copy() for part in start))
    nowhere = np.empty((0, 4), np.int64)
    spans, none = spans or (nowhere, nowhere), NO_SURFACES
    status, error, _ = solve_problem(p, sizes_of(p), found, none, *spans, room, np.zeros(1, np.int64))
    return status, error, found


@pytest.mark.long
@pytest.mark.parametrize("bodies", [CROWDED // 3 - 1, CROWDED // 3 + 5])
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_few_entries_give_the_same_answer(model: rw.Rung, bodies: int) -> None:
    for seed, steps in ((0, 150), (1, 250), (2, 350)):
        p, answer, spans = problem_of(model, heap(bodies, seed), steps)
        assert len(p.mu) > 0
        for start in (None, answer):
            status, _, dense = solved(p, None, start)
            same, error, sparse = solved(kept(p, *spans), spans, start)
            assert status == same == SOLVED
            rows = np.zeros((3, len(p.w) + len(p.F) + 6))
            assert error <= TOLERANCE and residual_of_rows(p, sizes_of(p), sparse, rows) <= TOLERANCE
            np.testing.assert_allclose(sparse.v, dense.v, rtol=0.0, atol=1e-7 * (1.0 + abs(dense.v).max()))


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(2))
def test_heaps_that_collapse_are_solved_by_their_few_entries(seed: int, tmp_path: Path) -> None:
    """Nothing is left to the search over modes."""
    scene = on_ground(triangles(CROWDED // 3 + 2, seed), duration=1.0, step=2e-3)
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, save_hard=tmp_path)
    assert run.outcome.name == "timeout" and run.worst_residual <= TOLERANCE
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_a_pile_repeats_and_does_not_depend_on_the_order_of_its_bodies() -> None:
    bodies = heap(24, 4)
    ends = []
    for order in (range(24), range(24), range(23, -1, -1)):
        run = rw.simulate(on_ground([bodies[i] for i in order], step=2e-3, duration=0.4), "dynamic-rigid")
        ends.append(run.workspace.state.q.reshape(-1, 3)[np.argsort(order)])  # type: ignore[union-attr]
    assert np.array_equal(ends[0], ends[1])
    np.testing.assert_allclose(ends[0], ends[2], atol=1e-9)


@pytest.mark.long
def test_a_pyramid_at_rest_goes_on_by_the_same_forces() -> None:
    """Also where rounding decides which of two contacts of faces comes first: nothing is solved anew."""
    run = Simulation(on_ground(pyramid(13), duration=1.0), rw.DYNAMIC_RIGID)
    run.advance(20)
    assert run.workspace is not None
    assert not run.workspace.scratch.v_new.any()


@pytest.mark.long
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_a_pyramid_stands(model: rw.Rung) -> None:
    run = rw.simulate(on_ground(pyramid(9), duration=0.02), model)
    assert run.outcome.name == "timeout" and run.worst_residual <= 1e-9
    assert np.abs(run.workspace.state.v).max() <= 1e-9 + (0.01 if model.compliant else 0.0)  # type: ignore[union-attr]


@pytest.mark.few(2)
@pytest.mark.parametrize(("model", "tol"), [(DYNAMIC[0], None), (DYNAMIC[1], None), (DYNAMIC[1], 1e-2)])
def test_slots_of_pairs_that_are_not_listed_need_no_copy(model: rw.Rung, tol: float | None) -> None:
    """A heap that falls, beside the same one whose slots are all copied and cleared in each step."""
    scene = on_ground(heap(20, 3), duration=10.0, step=2e-3)
    runs = [Simulation(scene, model, tol=tol, frames=120) for _ in range(2)]
    for _ in range(120):
        for run, copies in zip(runs, (False, True), strict=True):
            run.advance(1)
            assert run.workspace is not None
            if copies:
                run.workspace.state.manifolds.turn[0] += 1
    for name in ("memory", "impulse"):
        ours, other = (getattr(run.workspace.frames, name) for run in runs)  # type: ignore[union-attr]
        np.testing.assert_array_equal(ours, other)
    assert runs[0].workspace.state.manifolds.turn[0] > 3  # type: ignore[union-attr]
