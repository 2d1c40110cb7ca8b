"""Dry friction of a body along several coordinates is one force in an ellipsoid, against the motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.step import OPEN, SOLVED, STICK, Sizes, allocate_problem
from rungwise.simulation.core.chains import solve_scratch
from rungwise.simulation.core.state import CLOCK, Scratch, State, scratch_arrays, state_arrays
from rungwise.simulation.planar.state.workspace import SCALARS
from rungwise.system.terms import allocate_terms

RNG = np.random.default_rng(7)
HEADINGS = [float(a) for a in RNG.uniform(0.0, 2.0 * math.pi, 6)]


def puck(
    vx: float, vy: float, spin: float = 0.0, F: float = 1.0, lever: float = 0.1, **more: Any
) -> dict[str, Any]:
    """A disc of mass 1 and radius of gyration 0.1 on its support."""
    return {
        "role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0, "inertia": 0.01,
        "motion": {"kind": "free"},
        "coordinates": {
            "x": {"speed": vx, "dry_friction": F},
            "y": {"speed": vy, "dry_friction": F},
            "angle": {"speed": spin, "dry_friction": F * lever},
        },
        **more,
    }  # fmt: skip


def scene(bodies: dict[str, Any], contacts: list[Any] | None = None, **more: Any) -> dict[str, Any]:
    return {
        "name": "support",
        "bodies": bodies,
        "contacts": contacts or [],
        "step": 1e-3,
        "duration": 2.0,
        **more,
    }


@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
@pytest.mark.parametrize("heading", HEADINGS)
def test_a_body_stops_after_the_same_distance_whatever_its_heading(model: str, heading: float) -> None:
    v, F, h = 0.8, 1.3, 1e-3
    run = rw.simulate(scene({"p": puck(v * math.cos(heading), v * math.sin(heading), F=F)}, step=h), model)
    x, y = run.final["p"]["x"], run.final["p"]["y"]
    # Implicit steps: v_k = v - k F h until it stops in step ceil(v / (F h)).
    speeds = np.maximum(v - F * h * np.arange(1, 1 + math.ceil(v / (F * h))), 0.0)
    assert math.hypot(x, y) == pytest.approx(h * speeds.sum(), rel=1e-9)
    assert abs(math.remainder(math.atan2(y, x) - heading, 2.0 * math.pi)) < 1e-9
    assert run.final["p"]["angle"] == 0.0


def test_spin_and_slide_fall_along_the_curve_of_the_ellipsoid() -> None:
    """omega / omega_0 = (v / v_0)^(lever^2 / rho^2), rho the radius of gyration."""
    rho = 0.1
    for lever in (0.05, 0.1, 0.15):
        errors = []
        for h in (1e-3, 2.5e-4):
            bodies = {"p": puck(0.6, 0.3, 7.0, lever=lever)}
            run = rw.simulate(scene(bodies, step=h, duration=0.4), "dynamic-rigid")
            assert run.workspace is not None
            v = run.workspace.state.v
            expected = 7.0 * (math.hypot(v[0], v[1]) / math.hypot(0.6, 0.3)) ** (lever**2 / rho**2)
            errors.append(abs(v[2] - expected))
        assert errors[1] < 0.3 * errors[0] or errors[1] < 1e-9
        assert errors[1] < 2e-3


def test_a_sticking_push_moves_the_part_as_its_ellipse_says() -> None:
    """Lynch: v = ((c^2 + x^2) u_x + x y u_y, x y u_x + (c^2 + y^2) u_y) / (c^2 + x^2 + y^2)."""
    for c, y, F in ((0.05, 0.03, 2.0), (0.1, -0.04, 0.1), (0.02, 0.0, 1.0)):
        part = puck(0.0, 0.0, F=F, lever=c, shape={"kind": "box", "width": 0.2, "height": 0.2})
        finger = {
            "role": "robot", "shape": {"kind": "point"}, "pose": {"x": -0.1, "y": y},
            "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
            "coordinates": {"x": {"drive": {"kind": "speed", "speed": 0.01}}},
        }  # fmt: skip
        given = scene({"p": part, "f": finger}, [{"between": ["f", "p"], "friction": 5.0}], duration=1e-3)
        run = rw.simulate(given, "quasistatic-rigid", step=1e-3)
        assert run.workspace is not None
        v = run.workspace.state.v[:3]
        x, u, total = -0.1, 0.01, c**2 + 0.1**2 + y**2
        expected = [(c**2 + x**2) * u / total, x * y * u / total]
        turn = (x * expected[1] - y * expected[0]) / c**2
        np.testing.assert_allclose(v, [*expected, turn], rtol=1e-7, atol=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "model", ["quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid", "dynamic-compliant"]
)
def test_random_parts_pushed_into_each_other_obey_the_law(model: str) -> None:
    """No run fails, and in every recorded step the support takes energy."""
    rng = np.random.default_rng(11)
    for _ in range(6):
        bodies: dict[str, Any] = {}
        for i in range(3):
            shape = [
                {"kind": "disc", "radius": 0.05},
                {"kind": "box", "width": 0.1, "height": 0.08},
                {"kind": "polygon", "vertices": [[0, 0], [0.1, 0.0], [0.05, 0.09]]},
            ][int(rng.integers(3))]
            bodies[f"p{i}"] = puck(
                0.0, 0.0, F=10.0 ** rng.uniform(-1, 1), lever=rng.uniform(0.01, 0.06), shape=shape,
                pose={"x": 0.17 * i, "y": float(rng.uniform(-0.03, 0.03)), "angle": float(rng.uniform(0, 6))},
            )  # fmt: skip
        bodies["f"] = {
            "role": "robot", "shape": {"kind": "disc", "radius": 0.02}, "pose": {"x": -0.12},
            "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
            "coordinates": {"x": {"upper": 0.25, "drive": {"kind": "speed", "speed": 0.3}}},
        }  # fmt: skip
        contacts = [{"between": ["*", "*"], "friction": float(rng.uniform(0.0, 0.8)), "damping": 200.0}]
        run = rw.simulate(scene(bodies, contacts, duration=0.9), model, step=3e-3)
        assert str(run.outcome) in ("missed", "timeout"), run.reason
        assert run.workspace is not None
        frames, count = run.workspace.frames, int(run.workspace.state.clock[0]["frames"])
        work = np.diff(frames.scalars[:count, SCALARS.index("support_work")])
        assert (work <= 1e-12).all() and work.min() < 0.0


def test_one_axis_rubs_as_before() -> None:
    body = puck(1.0, 1.0)
    body["coordinates"] = {"x": {"speed": 1.0, "dry_friction": 2.0}, "y": {"speed": 1.0}}
    run = rw.simulate(scene({"p": body}), "dynamic-rigid")
    assert run.final["p"]["x"] == pytest.approx(0.25 - 0.5e-3, abs=1e-9)
    assert run.final["p"]["y"] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.long
def test_random_steps_of_one_body_and_one_contact_meet_the_law() -> None:
    """Balance and maximum dissipation of 2000 steps with inertia, and of 2000 in the limit without."""
    n = 3
    terms, problem = allocate_terms(n, 1, n), allocate_problem(n, 1, n)
    state = State(clock=np.zeros(1, CLOCK), v=np.zeros(n), **state_arrays(n, 1))
    scratch = Scratch(**scratch_arrays(n, 1, n))
    state.free[:], terms.surface[:] = range(n), 0
    rng, stuck, p = np.random.default_rng(1), 0, problem
    for k in range(4000):
        inertia, h = 10.0 ** rng.uniform(-3, -1, 2)
        c, F = 10.0 ** rng.uniform(-2, 0), 10.0 ** rng.uniform(-1, 1)
        v = rng.normal(size=3) * 10.0 ** rng.uniform(-2, 1) if k % 2 else np.zeros(3)
        arm, give, mu = rng.uniform(-0.1, 0.1), rng.choice([0.0, 1e-3, 0.1]), rng.choice([0.0, 0.3, 1.0])
        p.H[:] = np.diag([1.0, 1.0, inertia]) / h * (1.0 if k % 2 else 1e-8 * F * h)
        p.c[:], p.W[:], p.mu[0] = p.H @ v, [[1.0, 0.0, -arm], [0.0, 1.0, -0.1]], mu
        p.w[:] = [-abs(rng.normal()) * 10.0 ** rng.uniform(-2, 0), 0.1 * rng.normal() if mu > 0.0 else 0.0]
        p.R[0], p.S[:], p.R_s[:], p.w_s[:], p.F[:] = give * np.eye(2), np.diag([1.0, 1.0, c]), 0.0, 0.0, F
        terms.limited[:], terms.limit[:], state.v[:] = p.S, F, v
        scratch.mode[:], scratch.contact_force[:], scratch.limited_force[:] = [OPEN, *[STICK] * 3], 0.0, 0.0
        status, found, _ = solve_scratch(problem, Sizes(n, 1, n), terms, scratch, True)
        assert status == SOLVED and found < 1e-8, k
        v, tau, force = scratch.x, scratch.limited_force, scratch.contact_force
        S, size = np.diag([1.0, 1.0, c]), float(np.linalg.norm(tau))
        speed = float(np.linalg.norm(S @ v))
        assert size <= F * (1.0 + 1e-9)
        assert tau @ S @ v == pytest.approx(-F * speed, rel=1e-9, abs=1e-12 * F)
        load = max(F, np.abs(force).max(), np.abs(p.c).max())
        np.testing.assert_allclose(p.H @ v - p.c - p.W.T @ force - S @ tau, 0.0, atol=1e-10 * load)
        stuck += speed == 0.0 or size < F * (1.0 - 1e-9)
    assert 200 < stuck < 1000
