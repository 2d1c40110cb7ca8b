"""The limit surface of a support's pressure: rings, discs and feet whose motion is known, and symmetries."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipe, ellipk

import rungwise as rw
from rungwise.contact.kinds.pressure import dissipation
from rungwise.contact.step import OPEN, SOLVED, STICK, Sizes, allocate_problem, trim
from rungwise.kernel import Reals
from rungwise.simulation.core.chains import solve_scratch
from rungwise.simulation.core.limit_surface import in_boxes
from rungwise.simulation.core.state import Scratch, scratch_arrays
from rungwise.system.terms import allocate_terms
from rungwise.world.planar.surroundings import PlanarSurroundings
from tests.contact.test_pressure import LOADS, turned
from tests.simulation.scaling import Units, scaled

R, MU, G = 0.1, 0.3, 10.0
RING = {"kind": "ring", "radius": R}
THIN = LOADS["thin"]
"""Numbers of a load on a thin strip."""


def lying(
    v: float, w: float, pressure: dict[str, Any] | None = None, heading: float = 0.0, **fields: Any
) -> dict[str, Any]:
    """A disc of radius R and mass 1 that slides at v, and spins so that its rim has the speed w."""
    support = {"friction": MU, "gravity": G, "limit_surface": "exact"}
    body = {
        "role": "object", "shape": {"kind": "disc", "radius": R}, "mass": 1.0, "motion": {"kind": "free"},
        "pose": {"angle": heading}, "support": support | ({"pressure": pressure} if pressure else {}),
        "coordinates": {
            "x": {"speed": v * math.cos(heading)}, "y": {"speed": v * math.sin(heading)},
            "angle": {"speed": w / R},
        },
    } | fields  # fmt: skip
    return {"name": "lying", "bodies": {"p": body}, "duration": 1.0, "step": 1e-3}


def speeds(run: rw.Run) -> Reals:
    """Sliding and rim speed (frames, 2)."""
    v = run.trajectory.velocity.values
    return np.stack([np.hypot(v[:, 0], v[:, 1]), R * v[:, 2]], axis=1)


def stops(run: rw.Run) -> tuple[float, float]:
    """When a body stops to slide, and when it stops to spin."""
    still = np.abs(speeds(run)) < 1e-9
    assert still[-1].all()
    t = run.trajectory.time.values
    return float(t[np.argmax(still[:, 0])]), float(t[np.argmax(still[:, 1])])


@pytest.mark.long
@pytest.mark.parametrize("rung", [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT], ids=lambda rung: rung.name)
def test_a_ring_whose_rim_is_as_fast_as_its_centre_stays_so_until_it_stops(rung: rw.Rung) -> None:
    """Then friction is 2 / pi of mu N along both, and it stops after pi v / (2 mu g); with the ellipsoid
    friction is 1 / sqrt(2)."""
    run = rw.simulate(lying(0.6, 0.6, RING, inertia=R * R), rung)
    slide, spin = stops(run)
    assert slide == spin == pytest.approx(0.5 * math.pi * 0.6 / (MU * G), abs=2e-3)
    np.testing.assert_allclose(*speeds(run)[:300].T, rtol=1e-3)
    data = lying(0.6, 0.6, RING, inertia=R * R)
    data["bodies"]["p"]["support"]["limit_surface"] = "ellipsoid"
    assert stops(rw.simulate(data, rung))[0] == pytest.approx(math.sqrt(2.0) * 0.6 / (MU * G), abs=2e-3)


def ring_forces(v: float, w: float) -> tuple[float, float]:
    """Gradient of P = 2 (v + w) E(m) / pi, m = 4 v w / (v + w)^2."""
    total, m = v + w, 4.0 * v * w / (v + w) ** 2
    e, slope = ellipe(m), (ellipe(m) - ellipk(m)) / (2.0 * m)
    return tuple(2.0 / math.pi * (e + total * slope * (4.0 * b / total**2 - 2.0 * m / total)) for b in (w, v))  # type: ignore[return-value]


@pytest.mark.long
@pytest.mark.parametrize("w", [0.05, 0.3, 2.0])
def test_rings_slow_down_as_elliptic_integrals_say(w: float) -> None:
    run = rw.simulate(lying(0.6, w, RING, inertia=R * R), rw.DYNAMIC_RIGID, step=2.5e-4, duration=0.15)

    def slow(_: float, u: Reals) -> list[float]:
        return [-MU * G * force for force in ring_forces(*u)]

    exact = solve_ivp(slow, (0.0, 0.15), [0.6, w], rtol=1e-9, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(speeds(run)[-1], exact, atol=2e-3 * max(exact))


def test_discs_come_to_rest_at_the_ratio_that_is_known() -> None:
    """Slide and spin end together, at v = 0.653 R omega, however they began (Farkas, Bartels, Unger and Wolf
    2003); sooner with more spin, and both later than alone."""
    ends = []
    for w in (0.7, 1.0, 1.3):
        run = rw.simulate(lying(0.6, w), rw.DYNAMIC_RIGID, step=5e-4, duration=0.5)
        slide, spin = stops(run)
        assert slide == pytest.approx(spin, abs=1e-3)
        assert slide > 0.6 / (MU * G)
        moving = speeds(run)[speeds(run)[:, 0] > 2e-3]
        ends.append(moving[-1, 0] / moving[-1, 1])
    np.testing.assert_allclose(ends, 0.653, atol=0.02)


@pytest.mark.few(1)
@pytest.mark.parametrize("pressure", [None, RING], ids=["disc", "ring"])
def test_slide_and_spin_alone_are_those_of_the_ellipsoid(pressure: dict[str, Any] | None) -> None:
    lever = R if pressure else 2.0 * R / 3.0
    run = rw.simulate(lying(0.6, 0.0, pressure), rw.DYNAMIC_RIGID)
    assert stops(run)[0] == pytest.approx(0.6 / (MU * G), abs=2e-3)
    run = rw.simulate(lying(0.0, 0.6, pressure), rw.DYNAMIC_RIGID)
    assert stops(run)[1] == pytest.approx(0.5 * R * 0.6 / (MU * G * lever), abs=2e-3)


def feet(part: float, **support: Any) -> dict[str, Any]:
    """A bar on two feet, each of which carries half of it, pulled sideways at one foot."""
    pull = part * MU * G
    pressure = {"kind": "points", "points": [[R, 0.0], [-R, 0.0]]}
    drag = {name: {"damping": 1e-3} for name in ("x", "y", "angle")}
    data = lying(0.0, 0.0, pressure, force=[0.0, pull], torque=pull * R, coordinates=drag)
    data["bodies"]["p"]["support"] |= support
    return data | {"duration": 0.02}


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "rung", [rung for rung in rw.LADDER if rung.moves and rung.loads], ids=lambda rung: rung.name
)
def test_a_bar_that_is_pulled_at_a_foot_turns_about_the_other(rung: rw.Rung) -> None:
    """It gives way at half of mu N, and the other foot stays; by the ellipsoid it holds to 1 / sqrt(2)."""
    assert rw.simulate(feet(0.498), rung).final["p"]["angle"] == 0.0
    moved = rw.simulate(feet(0.51), rung).final["p"]
    assert moved["angle"] > 0.0
    assert abs(moved["y"] - R * math.sin(moved["angle"])) < 0.02 * moved["y"]
    assert rw.simulate(feet(0.7, limit_surface="ellipsoid"), rung).final["p"]["angle"] == 0.0


@pytest.mark.few(1)
@pytest.mark.parametrize("heading", [0.7, 2.5, -1.9])
@pytest.mark.parametrize(
    "shape",
    [
        {"kind": "box", "width": 0.2, "height": 0.1},
        {"kind": "box", "width": 0.2, "height": 0.1, "radius": 0.03},
        {"kind": "polygon", "vertices": [[-0.1, -0.05], [0.12, -0.03], [0.0, 0.1]]},
    ],
    ids=["box", "rounded", "triangle"],
)
def test_the_motion_does_not_depend_on_the_heading(shape: dict[str, Any], heading: float) -> None:
    here = rw.simulate(lying(0.5, 0.4, shape=shape), rw.DYNAMIC_RIGID, duration=0.3)
    there = rw.simulate(lying(0.5, 0.4, heading=heading, shape=shape), rw.DYNAMIC_RIGID, duration=0.3)
    np.testing.assert_allclose(speeds(there), speeds(here), atol=1e-9)


def test_a_mirrored_motion_is_mirrored_and_other_units_change_nothing() -> None:
    shape = {"kind": "box", "width": 0.2, "height": 0.1}
    one, other = (
        rw.simulate(lying(0.5, side * 0.4, shape=shape), rw.DYNAMIC_RIGID, duration=0.2)
        for side in (1.0, -1.0)
    )
    v, u = one.trajectory.velocity.values, other.trajectory.velocity.values
    np.testing.assert_allclose(u, v * [1.0, -1.0, -1.0], atol=1e-10)
    data = lying(0.5, 0.4, shape=shape) | {"duration": 0.2}
    units = Units(length=1e3, mass=1e-3, time=10.0)
    there = rw.simulate(scaled(rw.load(data), units), rw.DYNAMIC_RIGID).trajectory.velocity.values
    np.testing.assert_allclose(there * [1e-2, 1e-2, 10.0], v, atol=1e-10)


@pytest.mark.parametrize("slow", [25.0, 35.0])
def test_far_turns_are_those_of_spots_as_well_as_of_edges(slow: float) -> None:
    """Where the place about which a body turns is far, spots stand for the load. Either way the spin of a
    disc falls as the root of its speed, for its torque is mu N R^2 omega / (4 v)."""
    run = rw.simulate(lying(0.6, 0.6 * 1.5 / slow), rw.DYNAMIC_RIGID, step=5e-4, duration=0.1)
    slide, rim = speeds(run).T
    np.testing.assert_allclose(rim**2 / slide, rim[0] ** 2 / slide[0], rtol=5e-3)


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", [rung for rung in rw.LADDER if rung.moves], ids=lambda rung: rung.name)
def test_a_rod_pushes_a_box_on_each_rung(rung: rw.Rung) -> None:
    """Beside its centre, so that it turns; the law changes how far, by a few per cent."""
    found = []
    for surface in ("ellipsoid", "exact"):
        pusher = {
            "role": "robot", "shape": {"kind": "disc", "radius": 0.02}, "pose": {"x": -0.1201, "y": 0.02},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"drive": {"kind": "speed", "speed": 0.05}}},
        }  # fmt: skip
        box = {
            "role": "object", "shape": {"kind": "box", "width": 0.2, "height": 0.1}, "mass": 1.0,
            "motion": {"kind": "free"},
            "support": {"friction": MU, "gravity": G, "limit_surface": surface},
        }  # fmt: skip
        contact = {"between": ["pusher", "box"], "friction": 0.3, "stiffness": 1e5, "damping": 1e3}
        data = {"name": "push", "bodies": {"pusher": pusher, "box": box}, "contacts": [contact]}
        run = rw.simulate(data | {"duration": 1.0, "step": 5e-3}, rung)
        assert run.outcome == "timeout"
        found.append(run.final["box"])
    if rung.loads:
        assert found[0]["angle"] != found[1]["angle"]
        assert found[1]["angle"] == pytest.approx(found[0]["angle"], rel=0.2)
    else:
        assert found[0] == found[1]


def test_bodies_side_by_side_move_as_alone_and_meet_their_laws_to_rounding() -> None:
    """Each with a pressure of its own, beside one on three feet and one with an ellipsoid."""
    feet = {"kind": "points", "points": [[R, 0.0], [-R, 0.02], [0.0, R]], "weights": [1.0, 2.0, 0.5]}
    bodies = {
        "disc": lying(0.6, 0.3), "feet": lying(0.5, 0.4, feet), "ring": lying(0.4, -0.2, RING),
        "box": lying(0.5, 0.4, heading=0.3, shape={"kind": "box", "width": 0.2, "height": 0.1}),
        "oval": lying(0.6, 0.3),
    }  # fmt: skip
    bodies["oval"]["bodies"]["p"]["support"]["limit_surface"] = "ellipsoid"
    alone = {name: rw.simulate(data, rw.DYNAMIC_RIGID, duration=0.3) for name, data in bodies.items()}
    own = {name: data["bodies"]["p"] for name, data in bodies.items()}
    for k, body in enumerate(own.values()):
        body["pose"]["x"] = float(k)
    data = {"name": "beside", "bodies": own, "duration": 0.3, "step": 1e-3}
    together = rw.simulate(data, rw.DYNAMIC_RIGID)
    assert together.worst_residual < 1e-11
    for k, name in enumerate(bodies):
        for coordinate, value in alone[name].final["p"].items():
            moved = together.final[name][coordinate] - (k if coordinate == "x" else 0.0)
            assert moved == pytest.approx(value, abs=1e-12), (name, coordinate)


@pytest.mark.parametrize("load", LOADS)
def test_random_steps_of_one_body_and_one_contact_meet_the_law(load: str) -> None:
    """Balance and dissipation of 300 steps with inertia, and of 300 in the limit without, from nothing."""
    n, table = 3, LOADS[load]
    terms = allocate_terms(n, 1, n, surfaces={"exact": np.zeros((1, 4)), "pressures": table})
    p, scratch = allocate_problem(n, 1, n), Scratch(**scratch_arrays(n, 1, n))
    terms.surface[:], rng, stuck = 0, np.random.default_rng(1), 0
    for k in range(600):
        inertia, h = 10.0 ** rng.uniform(-3, -1, 2)
        c, F, turn = 10.0 ** rng.uniform(-2, 0), 10.0 ** rng.uniform(-1, 1), rng.uniform(-4.0, 4.0)
        v = rng.normal(size=3) * 10.0 ** rng.uniform(-2, 1) if k % 2 else np.zeros(3)
        arm, give, mu = rng.uniform(-0.1, 0.1), rng.choice([0.0, 1e-3, 0.1]), rng.choice([0.0, 0.3])
        p.H[:] = np.diag([1.0, 1.0, inertia]) / h * (1.0 if k % 2 else 1e-8 * F * h)
        p.c[:], p.W[:], p.mu[0] = p.H @ v, [[1.0, 0.0, -arm], [0.0, 1.0, -0.1]], mu
        p.w[:] = [-abs(rng.normal()) * 10.0 ** rng.uniform(-2, 0), 0.1 * rng.normal() if mu > 0.0 else 0.0]
        S = np.diag([1.0, 1.0, c])
        p.R[0], p.S[:], p.F[:] = give * np.eye(2), S, F
        terms.exact[0] = 0.0, math.cos(turn), math.sin(turn), 0.0
        scratch.mode[:], scratch.contact_force[:], scratch.limited_force[:] = [OPEN, *[STICK] * 3], 0.0, 0.0
        status, found, _ = solve_scratch(p, Sizes(n, 1, n), terms, scratch, True)
        assert status == SOLVED and found < 1e-9, k
        tau, force, u = scratch.limited_force, scratch.contact_force, S @ scratch.x
        size = max(F, np.abs(force).max(), np.abs(p.c).max())
        np.testing.assert_allclose(p.H @ scratch.x - p.c - p.W.T @ force - S @ tau, 0.0, atol=1e-10 * size)
        stuck += not u.any()
        if u.any():
            power = dissipation(table, tuple(turned(turn).T @ u))[0]
            assert tau @ u == pytest.approx(-F * power, rel=1e-9, abs=1e-12 * F)
    assert 20 < stuck < 200


def test_what_may_be_proved_without_the_law_has_room_for_all_its_forces() -> None:
    """The limit surface of a thin load reaches beyond the ellipsoid, so a box about that along some force is
    none about it."""
    terms = allocate_terms(3, 0, 3, surfaces={"exact": np.array([[0.0, 1.0, 0.0, 0.0]]), "pressures": THIN})
    terms.surface[:], force = 0, np.array(dissipation(THIN, (0.64, 0.0, 0.77))[1])
    problem = allocate_problem(3, 0, 3)
    problem.S[:], problem.F[:] = np.eye(3), 2.0
    boxed = in_boxes(trim(problem, 3, 0, 3), terms, 1.5 * force)
    assert np.linalg.norm(force) > 1.04
    assert np.abs(np.linalg.solve(boxed.S.T, 2.0 * force)).max() <= 2.0


def test_planners_balance_by_the_ellipsoid_whatever_carries_a_body() -> None:
    """Rows of a few points are of no use to them: they take those of one body for one surface."""
    pressure = {"kind": "points", "points": [[R, 0.0], [-R, 0.02], [0.0, R]], "weights": [1.0, 2.0, 0.5]}
    found = []
    for surface in ("ellipsoid", "exact"):
        data = lying(0.0, 0.0, pressure, heading=0.3)
        data["bodies"]["p"]["support"]["limit_surface"] = surface
        scene = rw.load(data)
        around = PlanarSurroundings(scene, scene.parameters())
        found.append(around.touches(rw.State.of(scene).q, 0.0).supports)
    assert found[0].rows.shape == (3, 3)
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_law_without_pressure_is_refused_in_a_line() -> None:
    data = lying(0.1, 0.0, {"kind": "ratio", "ratio": 0.1})
    with pytest.raises(rw.SceneError, match="limit_surface: exact needs a pressure: uniform, ring or points"):
        rw.load(data)
    data = lying(0.1, 0.0)
    data["bodies"]["p"]["support"]["centre"] = [0.01, 0.0]
    with pytest.raises(rw.SceneError, match="leave centre out"):
        rw.load(data)
