"""Order of error-controlled steps between events, and what a push costs."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rungwise as rw

from .conftest import MOVING

SPEED, RADIUS = 0.1, 0.01
LINKED = {"hinge": {"kind": "hinge", "between": ["part", "tail"], "at": [0.13, 0.0]}}


def support(rubs: bool, force: float) -> dict[str, Any]:
    """Coordinates of a body on a plane that resists by dry friction, or in proportion to speed."""
    kind, along, about = ("dry_friction", force, 0.07) if rubs else ("damping", force / 0.05, 0.07**2)
    return {"x": {kind: along}, "y": {kind: along}, "angle": {kind: along * about}}


def pushed(seed: int, *, linked: bool = False) -> rw.Scene:
    """A part pushed by a disc that slides or swings: three shapes, two kinds of support, little friction or
    much; contacts at critical damping."""
    rng = np.random.default_rng(seed)
    half, mass = rng.uniform(0.08, 0.12), rng.uniform(0.3, 0.7)
    shape: dict[str, Any] = {"kind": "box", "width": 2.0 * half, "height": rng.uniform(0.1, 0.2)}
    if seed % 3 == 1:
        corners = [[-half, -0.05], [half, -0.07], [0.12, 0.02], [0.03, 0.09], [-half, 0.05]]
        shape = {"kind": "polygon", "vertices": corners}
    elif seed % 3 == 2:
        shape = {"kind": "disc", "radius": half}
    force, off = mass * 9.81 * rng.uniform(0.2, 0.4), rng.uniform(-0.035, 0.035)
    reach = math.sqrt((half + RADIUS) ** 2 - off**2) if seed % 3 == 2 else half + RADIUS
    pusher: dict[str, Any] = {
        "role": "robot",
        "shape": {"kind": "disc", "radius": RADIUS},
        "pose": {"x": -reach - 1e-9, "y": off},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
        "coordinates": {"x": {"drive": {"kind": "speed", "speed": SPEED}}},
    }
    if seed // 12 % 2:
        pusher["motion"] = {"kind": "hinge", "pivot": [-reach, off - 0.3]}
        pusher["coordinates"] = {"angle": {"drive": {"kind": "speed", "speed": -SPEED / 0.3}}}
    rubs, stiffness = bool(seed // 3 % 2), 1e5
    part = {"role": "object", "mass": mass, "shape": shape, "motion": {"kind": "free"}}
    bodies = {"pusher": pusher, "part": part | {"coordinates": support(rubs, force)}}
    if linked:
        tail = {"role": "object", "mass": 0.2, "shape": {"kind": "box", "width": 0.02, "height": 0.1}}
        tail |= {"pose": {"x": 0.2}, "motion": {"kind": "free"}, "coordinates": support(rubs, 0.5)}
        bodies["tail"] = tail
    contact = {"between": ["pusher", "part"], "friction": [0.05, 0.8][seed // 6 % 2], "stiffness": stiffness}
    contact |= {"damping": 2.0 * math.sqrt(stiffness * mass)}
    data: dict[str, Any] = {"name": "pushed", "bodies": bodies, "contacts": [contact], "step": 1e-3}
    return rw.load(data | {"tolerance": 1e-5, "duration": 1.0, "joints": LINKED if linked else {}})


def place(run: rw.Run, body: str = "part") -> NDArray[np.float64]:
    """Where a body is, with its angle as a length."""
    assert run.outcome.name == "timeout", run.reason
    return np.array([run.final[body][name] for name in ("x", "y", "angle")]) * [1.0, 1.0, 0.1]


def order(counts: list[int], errors: list[float]) -> float:
    """Exponent p of errors ~ counts^-p."""
    return float(-np.polyfit(np.log(counts), np.log(errors), 1)[0])


def measured(scene: rw.Scene, model: rw.Rung, tols: tuple[float, ...]) -> tuple[list[int], list[float]]:
    """Attempts and errors of runs that go on from a push under way, where nothing switches."""
    begun = rw.simulate(scene, model, tol=1e-9, duration=0.3, frames=3).state

    def end(tol: float) -> rw.Run:
        return rw.simulate(scene, model, tol=tol, state=begun, duration=0.6, frames=3)

    reference, runs = place(end(3e-11)), [end(tol) for tol in tols]
    return [run.attempts for run in runs], [float(np.abs(place(run) - reference).max()) for run in runs]


@pytest.mark.few(1)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("linked", [True, False])
def test_steps_between_events_are_of_second_order(model: rw.Rung, linked: bool) -> None:
    """Random parts, supports, friction and pushers; where it is linked the part draws another along. In few
    of the pushes something switches all the same."""
    members = [pushed(seed, linked=linked) for seed in range(0, 24, 8 if linked else 3)]
    orders = [order(*measured(scene, model, (1e-7, 3e-8, 1e-8, 3e-9))) for scene in members]
    assert np.median(orders) >= 1.8, orders


@pytest.mark.parametrize("tol", [1e-5, 1e-6])
def test_controlled_steps_are_as_long_as_their_error_allows(tol: float) -> None:
    """A load a t drags a body through oil, x' = a t / c: a whole step of first order and its halves part by
    a h^2 / 4 c, of which 0.81 of what is allowed is taken."""
    a, c = 6.0, 2.0
    body = {"role": "object", "mass": 1.0, "shape": {"kind": "disc", "radius": 0.1}, "force": [f"{a} * t", 0]}
    body |= {"motion": {"kind": "slide", "axis": [1, 0], "name": "s"}, "coordinates": {"s": {"damping": c}}}
    data = {"name": "oil", "bodies": {"part": body}, "contacts": [], "duration": 0.2, "step": 1e-2}
    run = rw.simulate(rw.load(data | {"tolerance": 1e-5}), rw.QUASISTATIC_RIGID, tol=tol, frames=1000)
    steps = np.diff(run.trajectory.time.values)
    assert np.median(steps) == pytest.approx(1.8 * math.sqrt(tol * c / a), rel=1e-4)
    assert run.final["part"]["s"] == pytest.approx(0.5 * a / c * 0.2**2, abs=tol)


HALF, MU, OFF = 0.1, 0.1, 0.05
CHARACTER = 0.3826 * 0.2
HEADING = np.array([0.05, 0.01])


def rate(q: NDArray[np.float64], time: float) -> tuple[NDArray[np.float64], int]:
    """Velocity of a part on a plane of dry friction (an ellipse of forces and moment) that a disc of radius
    0.02 pushes at its face x = -HALF, by hand: with the disc if the force for it is in the cone of friction,
    else on that edge of the cone; and which."""
    c, s = math.cos(q[2]), math.sin(q[2])
    turn = np.array([[c, -s], [s, c]])
    y = (turn.T @ (np.array([-HALF - 0.02, OFF]) + HEADING * time - q[:2]))[1]
    u, ease = turn.T @ HEADING, np.diag([1.0, 1.0, 1.0 / CHARACTER**2])
    at = np.array([[1.0, 0.0], [0.0, 1.0], [-y, -HALF]])
    yields = at.T @ ease @ at
    force, edge = np.linalg.solve(yields, u), 0
    if abs(force[1]) > MU * force[0]:
        edge = int(np.sign(force[1]))
        along = np.array([1.0, edge * MU])
        force = along * u[0] / (yields[0] @ along)
    v = ease @ at @ force
    return np.array([*(turn @ v[:2]), v[2]]), edge


def by_hand(duration: float, steps: int) -> tuple[NDArray[np.float64], int]:
    """Where the part is after so many steps of Runge and Kutta, and how often contact switched."""
    q, h, edges = np.zeros(3), duration / steps, []
    for k in range(steps):
        first, edge = rate(q, k * h)
        second = rate(q + 0.5 * h * first, (k + 0.5) * h)[0]
        third = rate(q + 0.5 * h * second, (k + 0.5) * h)[0]
        q = q + h / 6.0 * (first + 2.0 * second + 2.0 * third + rate(q + h * third, (k + 1) * h)[0])
        edges.append(edge)
    return q * [1.0, 1.0, HALF], sum(a != b for a, b in pairwise(edges))


def test_a_push_that_sticks_and_slips_takes_few_solves() -> None:
    """Against a part of 0.2 that is pushed by as much, and switches twice between sliding and sticking."""
    pace = float(np.hypot(*HEADING))
    pusher = {
        "role": "robot",
        "shape": {"kind": "disc", "radius": 0.02},
        "pose": {"x": -HALF - 0.02, "y": OFF},
        "motion": {"kind": "slide", "axis": [float(x) / pace for x in HEADING], "name": "s"},
        "coordinates": {"s": {"drive": {"kind": "speed", "speed": pace}}},
    }
    rubs = {"x": {"dry_friction": 1.0}, "y": {"dry_friction": 1.0}, "angle": {"dry_friction": CHARACTER}}
    part = {"role": "object", "mass": 1.0, "shape": {"kind": "box", "width": 2.0 * HALF, "height": 0.4}}
    part |= {"motion": {"kind": "free"}, "coordinates": rubs}
    contacts = [{"between": ["pusher", "part"], "friction": MU}]
    data = {"name": "trial", "bodies": {"pusher": pusher, "part": part}, "contacts": contacts, "step": 1e-3}
    scene = rw.load(data | {"duration": 4.0, "tolerance": 1e-5})
    expected, switches = by_hand(4.0, 4000)
    assert switches == 2
    costs: dict[float, int] = {}
    for tol in (1e-4, 5e-5, 2e-5, 1e-5, 1e-6, 5e-7, 2e-7, 1e-7):
        run = rw.simulate(scene, rw.QUASISTATIC_RIGID, tol=tol, frames=3)
        error = float(np.abs(place(run) - expected).max()) / (2.0 * HALF)
        for allowed in (1e-4, 1e-6):
            if error <= allowed:
                costs[allowed] = min(costs.get(allowed, run.solves), run.solves)
    assert costs[1e-4] <= 80 and costs[1e-6] <= 800, costs


@pytest.mark.parametrize("damping", [0.0, 5.0])
@pytest.mark.parametrize("tol", [1e-4, 1e-5, 1e-6])
def test_a_contact_that_closes_yields_by_its_law(damping: float, tol: float) -> None:
    """Against a box on a plane that resists its sliding, (d + C) x' = K e + C u, e' = u - x', in steps far
    longer than that takes."""
    speed, stiffness, drag = 0.1, 100.0, 0.5
    pusher = {
        "role": "robot",
        "shape": {"kind": "disc", "radius": RADIUS},
        "pose": {"x": -HALF - RADIUS},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
        "coordinates": {"x": {"drive": {"kind": "speed", "speed": speed}}},
    }
    part = {"role": "object", "shape": {"kind": "box", "width": 2.0 * HALF, "height": 0.1}}
    part |= {
        "motion": {"kind": "free"},
        "coordinates": {name: {"damping": drag} for name in ("x", "y", "angle")},
    }
    contacts = [{"between": ["pusher", "part"], "stiffness": stiffness, "damping": damping}]
    data = {"name": "line", "bodies": {"pusher": pusher, "part": part}, "contacts": contacts, "step": 1e-3}
    for duration in (0.02, 0.05, 0.2, 1.0):
        run = rw.simulate(data | {"duration": duration}, rw.QUASISTATIC_COMPLIANT, tol=tol, frames=3)
        yielded = speed * drag / stiffness * -math.expm1(-duration * stiffness / (drag + damping))
        assert run.final["part"]["x"] == pytest.approx(speed * duration - yielded, abs=tol)


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-5])
def test_turning_bodies_that_meet_a_floor_gain_no_energy(tol: float) -> None:
    """Capsules and boxes that turn while they fall: the far end comes round within a long step."""
    rng = np.random.default_rng(0)
    floor = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    for number in range(24):
        shape = {"kind": "capsule", "length": 0.3, "radius": 0.1}
        if number % 3 == 2:
            shape = {"kind": "box", "width": 0.3, "height": 0.2, "radius": 0.02}
        angle, turn = rng.uniform(-1.5, 1.5), rng.uniform(-6.0, 6.0)
        body = {
            "role": "object",
            "shape": shape,
            "mass": 1.0,
            "motion": {"kind": "free"},
            "pose": {"y": 0.5, "angle": angle},
            "coordinates": {"y": {"speed": -1.0}, "angle": {"speed": turn}},
        }
        contacts = [{"between": ["body", "floor"], "stiffness": 1e6}]
        data = {"name": "falls", "bodies": {"body": body, "floor": floor}, "contacts": contacts}
        run = rw.simulate(data | {"duration": 2.0, "step": 1e-3}, "dynamic-compliant", tol=tol)
        energy = run.trajectory["kinetic_energy"] + run.trajectory["elastic_energy"]
        assert float(energy.max()) < 1.02 * float(energy[0]), (number, tol)


def test_rigid_impacts_of_turning_bodies_converge_with_the_error_allowed() -> None:
    """A capsule that turns while it falls on its end, and is thrown, beside short steps."""
    body = {
        "role": "object",
        "shape": {"kind": "capsule", "length": 0.3, "radius": 0.1},
        "mass": 1.0,
        "motion": {"kind": "free"},
        "pose": {"y": 0.5, "angle": 1.17},
        "coordinates": {"y": {"speed": -1.0}, "angle": {"speed": 3.868}},
    }
    floor = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    data = {"name": "falls", "bodies": {"body": body, "floor": floor}, "duration": 2.0, "step": 1e-3}
    scene = rw.load(data | {"contacts": [{"between": ["body", "floor"]}]})
    exact = rw.simulate(scene, rw.DYNAMIC_RIGID, step=1e-5).final["body"]["y"]
    for tol in (1e-5, 1e-6, 1e-7):
        assert rw.simulate(scene, rw.DYNAMIC_RIGID, tol=tol).final["body"]["y"] == pytest.approx(
            exact, abs=1e-4
        )
