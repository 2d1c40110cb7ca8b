"""Bodies that fit exactly between others, bodies that friction alone carries, motions that nothing
resists."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.step import TOLERANCE

from .conftest import Make
from .rungs import QUASISTATIC, RIGID, WITH_LOADS, named

RADIUS, MU = 0.1, 0.5
GRAVITY = '<option gravity="0 0 -9.81"/>'
FREE = f'<freejoint/><geom name="g" type="sphere" size="{RADIUS}" mass="1"/>'
BOX = f'<freejoint/><geom name="g" type="box" size="{RADIUS} {RADIUS} {RADIUS}" mass="1"/>'


def held(make: Make, fixed: str, body: str, place: str) -> rw.SpaceScene:
    model = f'{GRAVITY}<worldbody>{fixed}<body name="b" pos="{place}">{body}</body></worldbody>'
    return make(model, duration=0.1, step=2e-3, contacts=[{"friction": MU}])


def among_balls(seed: int) -> tuple[str, str]:
    """A ball among two to six fixed ones that touch it, on a circle about it that is tilted a little."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 7))
    angles = 2.0 * math.pi * (np.arange(count) / count + 1e-3 * rng.uniform(-1.0, 1.0, count))
    places = [f"{2 * RADIUS * math.cos(a)!r} {2 * RADIUS * math.sin(a)!r} 0" for a in angles]
    return "".join(f'<geom type="sphere" size="{RADIUS}" pos="{at}"/>' for at in places), "0 0 0"


LID = '<geom type="plane" size="1 1 .1"/><geom type="box" size="1 1 .1" pos="0 0 .3"/>'
WALLS = '<geom type="box" size=".1 .3 .3" pos="-.2 0 .3"/><geom type="box" size=".1 .3 .3" pos=".2 0 .3"/>'
FITS = {
    "a ball between two planes": (LID, FREE, f"0 0 {RADIUS}"),
    "a box between two planes": (LID, BOX, f"0 0 {RADIUS}"),
    "a box in a U": ('<geom type="plane" size="1 1 .1"/>' + WALLS, BOX, f"0 0 {RADIUS}"),
    "a box between two walls": (WALLS, BOX, "0 0 .3"),
    "a ball between two walls": (WALLS, FREE, "0 0 .3"),
}


@pytest.mark.parametrize("rung", RIGID, ids=named)
@pytest.mark.parametrize("what", FITS)
def test_what_fits_exactly_rests(make: Make, what: str, rung: rw.Rung) -> None:
    run = rw.simulate(held(make, *FITS[what]), rung)
    assert str(run.outcome) == "timeout", run.reason
    assert not any(frame.v.any() for frame in run.frames) and run.worst_residual <= TOLERANCE


@pytest.mark.parametrize("rung", RIGID, ids=named)
@pytest.mark.parametrize("seed", range(6))
def test_friction_alone_holds_a_ball_among_others_where_it_may(make: Make, seed: int, rung: rw.Rung) -> None:
    fixed, place = among_balls(seed)
    run = rw.simulate(held(make, fixed, FREE, place), rung)
    assert str(run.outcome) == "timeout", run.reason
    assert run.final["b"]["z"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_a_ball_that_fits_exactly_rests_in_any_frame_and_unit(make: Make, seed: int) -> None:
    """Contacts opposite each other turn the ball about their line by rounding alone, and nothing resists."""
    rng = np.random.default_rng(seed)
    unit, mass, place = 10.0 ** rng.uniform(-3.0, 2.0), 10.0 ** rng.uniform(-2.0, 3.0), rng.normal(size=3)
    ball, other, turn = 0.1 * unit, rng.uniform(0.02, 0.2) * unit, rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    (w, x, y, z), place = turn, 10.0 * unit * place
    along = np.array([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)])
    down = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
    fixed = "".join(
        f'<geom type="plane" size="1 1 1" pos="{_text(place - side * ball * along)}"'
        f' zaxis="{_text(side * along)}"/>'
        if seed % 2
        else f'<geom size="{other!r}" pos="{_text(place - side * (ball + other) * along)}"/>'
        for side in (1.0, -1.0)
    )
    model = (
        f'<option gravity="{_text(-9.81 * unit * down)}"/><worldbody>{fixed}'
        f'<body name="b" pos="{_text(place)}" quat="{_text(turn)}"><freejoint/>'
        f'<geom size="{ball!r}" mass="{mass!r}"/></body></worldbody>'
    )
    scene = make(
        model, duration=0.05, step=1e-3, contacts=[{"friction": MU}], tolerance=1e-6 * unit,
    )  # fmt: skip
    for rung in RIGID:
        run = rw.simulate(scene, rung)
        assert str(run.outcome) == "timeout", run.reason
        assert np.abs(run.frames[-1].v).max() < 1e-9 * unit


def _text(numbers: np.ndarray) -> str:
    return " ".join(f"{x:.17g}" for x in numbers)


def test_without_friction_it_falls(make: Make) -> None:
    fixed, place = among_balls(0)
    model = f'{GRAVITY}<worldbody>{fixed}<body name="b" pos="{place}">{FREE}</body></worldbody>'
    scene = make(model, duration=0.1, step=2e-3, contacts=[{"friction": 0.0}])
    assert rw.simulate(scene, rw.DYNAMIC_RIGID).final["b"]["z"] < -0.04
    assert str(rw.simulate(scene, rw.QUASISTATIC_RIGID).outcome) == "unsupported"


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
def test_a_ball_between_two_tips_neither_spins_nor_falls(make: Make, seed: int, rung: rw.Rung) -> None:
    """Nothing resists a spin about the line between the contacts, and nothing drives it."""
    rng = np.random.default_rng(seed)
    tip, ball, mass = rng.uniform(0.005, 0.05), rng.uniform(0.01, 0.1), rng.uniform(0.02, 1.0)
    stiffness = 300.0 * mass * 9.81 / (ball + tip)
    fingers = "".join(
        f'<body name="{name}" pos="{side * (ball + tip)!r} 0 0">'
        f'<joint name="{name}" type="slide" axis="{-side} 0 0"/>'
        f'<geom type="sphere" size="{tip!r}" mass=".1"/></body>'
        for name, side in (("l", -1), ("r", 1))
    )
    servos = "".join(
        f'<position name="{name}" joint="{name}" kp="{stiffness!r}" kv="{0.01 * stiffness!r}"/>'
        for name in ("l", "r")
    )
    model = (
        f'{GRAVITY}<worldbody>{fingers}<body name="b"><freejoint/>'
        f'<geom type="sphere" size="{ball!r}" mass="{mass!r}"/></body></worldbody>'
        f"<actuator>{servos}</actuator>"
    )
    scene = make(
        model, controls={"l": 0.1 * ball, "r": 0.1 * ball}, duration=0.5, step=2e-3,
        contacts=[{"friction": 0.7, "stiffness": 1e5, "damping": 100.0}],
    )  # fmt: skip
    run = rw.simulate(scene, rung)
    assert str(run.outcome) == "timeout", run.reason
    end = run.final["b"]
    assert abs(end["qw"]) == pytest.approx(1.0, abs=1e-6)
    assert end["y"] == pytest.approx(0.0, abs=1e-9) and end["z"] == pytest.approx(0.0, abs=0.01 * ball)


def jaws(make: Make, seed: int) -> rw.SpaceScene:
    """Coupled jaws on a servo with a limit that push a part with dry friction to their middle."""
    rng = np.random.default_rng(seed)
    limit, loss, off = rng.uniform(2.0, 10.0), rng.uniform(0.1, 1.0), rng.uniform(-0.01, 0.01)
    bodies = "".join(
        f'<body name="{name}" pos="{side * 0.04} 0 0"><joint name="{name}" type="slide" axis="{-side} 0 0"/>'
        '<geom type="box" size=".005 .01 .02" mass=".05"/></body>'
        for name, side in (("l", -1), ("r", 1))
    )
    model = (
        f'<option gravity="0 0 0"/><worldbody>{bodies}<body name="p" pos="{off!r} 0 0">'
        f'<joint name="p" type="slide" axis="1 0 0" frictionloss="{loss!r}"/>'
        '<geom type="box" size=".01 .01 .01" mass=".1"/></body></worldbody>'
        '<equality><joint joint1="r" joint2="l"/></equality><actuator>'
        f'<position name="g" joint="l" kp="800" kv="10" forcerange="{-limit!r} {limit!r}"/></actuator>'
    )
    return make(model, controls={"g": "0.04*min(t,1)"}, duration=1.2, step=2e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_no_step_is_accepted_that_is_not_solved(make: Make, seed: int, rung: rw.Rung) -> None:
    run = rw.simulate(jaws(make, seed), rung)
    assert run.worst_residual <= TOLERANCE
    assert str(run.outcome) == "timeout", run.reason
