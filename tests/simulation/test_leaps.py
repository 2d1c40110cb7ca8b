"""Without momentum nothing leaps: what no balance leads to is unsupported, and what snaps is told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw

SLOW = ("quasistatic-rigid", "quasistatic-compliant")
G = 10.0


def scene(
    bodies: dict[str, Any], random: np.random.Generator, mu: float, slope: float = 0.0
) -> dict[str, Any]:
    """A scene of these bodies, all of which may touch, under gravity turned by `slope`; contacts and steps of
    any kind."""
    stiffness, damping, step = 10 ** random.uniform((5, 0, -4), (7, 2, -1))
    contacts = {"between": ["*", "*"], "friction": mu, "stiffness": stiffness, "damping": damping}
    return {
        "name": "leap",
        "gravity": [G * math.sin(slope), -G * math.cos(slope)],
        "bodies": bodies,
        "contacts": [contacts],
        "step": step,
        "duration": 5.0 * step,
    }


def fixed(width: float, height: float, **pose: float) -> dict[str, Any]:
    return {"role": "obstacle", "shape": {"kind": "box", "width": width, "height": height}, "pose": pose}


def free(shape: dict[str, Any], **pose: float) -> dict[str, Any]:
    return {"role": "object", "mass": 1.0, "shape": shape, "pose": pose, "motion": {"kind": "free"}}


def box(width: float, height: float) -> dict[str, Any]:
    return {"kind": "box", "width": width, "height": height}


def chute(random: np.random.Generator, steeper: float) -> dict[str, Any]:
    """A box on a slope whose angle is `steeper` times that of friction, with a wall below."""
    mu, far, tall = random.uniform(0.05, 0.9), 10 ** random.uniform(-2, 3), random.uniform(0.02, 0.05)
    bodies = {
        "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
        "wall": fixed(1.0, 1.0, x=far + 0.55, y=0.4),
        "box": free(box(0.1, tall), y=0.5 * tall),
    }
    wanted = scene(bodies, random, mu, math.atan(mu) * steeper)
    return wanted | {"goal": "gap(box, wall) <= 1e-3"}


def tower(random: np.random.Generator, out: float) -> dict[str, Any]:
    """Boxes on top of each other at the edge of a table, their common centre of mass beyond it by `out`."""
    count, drop = random.integers(1, 4), 10 ** random.uniform(-1, 2)
    bodies = {"table": fixed(1.0, 1.0, y=-0.5), "ground": fixed(9.0, 1.0, y=-1.5 - drop)}
    for i in range(count):
        bodies[f"box{i}"] = free(box(0.2, 0.1), x=0.5 + out, y=0.05 + 0.1 * i)
    return scene(bodies, random, random.uniform(0.3, 1.0))


def ladder(random: np.random.Generator, steeper: float) -> dict[str, Any]:
    """A uniform, thin rod on a wall, with friction at both ends, `steeper` times as steep as balance
    asks, tan = (1 - mu^2) / (2 mu) to the floor."""
    mu, thick = random.uniform(0.2, 0.8), 1e-6
    angle = math.atan((1.0 - mu * mu) / (2.0 * mu)) * steeper
    rod = {"kind": "capsule", "length": 1.0, "radius": thick, "angle": -angle}
    bodies = {
        "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
        "wall": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [1, 0]}},
        "rod": free(rod, x=thick + 0.5 * math.cos(angle), y=thick + 0.5 * math.sin(angle)),
    }
    return scene(bodies, random, mu)


CASES = {"chute": (chute, 0.97, 1.03), "tower": (tower, -0.01, 0.01), "ladder": (ladder, 1.03, 0.97)}
"""How each case is made, and numbers with which it is in balance, and is not."""


@pytest.mark.few(1)
@pytest.mark.parametrize("model", SLOW)
@pytest.mark.parametrize("case", CASES)
def test_what_nothing_holds_is_unsupported_however_far_it_would_go(case: str, model: str) -> None:
    make, balanced, lost = CASES[case]
    for seed in range(12):
        tol = (None, 1e-3, 1e-5)[seed % 3]
        for number, outcome in ((balanced, "timeout"), (lost, "unsupported")):
            run = rw.simulate(make(np.random.default_rng(seed), number), model, tol=tol)
            assert str(run.outcome) == outcome, (seed, run.reason)
            assert (run.certificate is not None) == (outcome == "unsupported")


@pytest.mark.few(1)
@pytest.mark.parametrize("model", SLOW)
def test_a_plate_that_tilts_lets_go_where_friction_ends(model: str) -> None:
    for seed in range(9):
        random = np.random.default_rng(seed)
        mu, far, pace = random.uniform((0.1, 0.3, 0.2), (1.0, 3.0, 2.0))
        turn = {
            "role": "robot",
            "motion": {"kind": "hinge", "pivot": [0, 0]},
            "coordinates": {"angle": {"drive": {"kind": "speed", "speed": -pace}}},
        }
        bodies = {
            "plate": turn | {"shape": box(2.0 * far + 2.0, 0.1), "pose": {"y": -0.05}},
            "stop": turn | {"shape": box(0.1, 1.0), "pose": {"x": far, "y": 0.5}},
            "box": free(box(0.1, 0.05), y=0.025),
        }
        tilting = scene(bodies, random, mu)
        tilting["contacts"][0]["between"] = ["box", "*"]
        ends, step = math.atan(mu) / pace, 0.02 * math.atan(mu) / pace
        run = rw.simulate(
            tilting | {"duration": 2.0 * ends, "step": step}, model, tol=(None, 1e-3, 1e-5)[seed % 3]
        )
        assert str(run.outcome) == "unsupported", (seed, run.reason)
        assert run.time == pytest.approx(ends, abs=2.0 * step)


@pytest.mark.few(1)
@pytest.mark.parametrize("model", SLOW)
def test_what_a_finger_lets_go_of_is_unsupported(model: str) -> None:
    for seed in range(9):
        random = np.random.default_rng(seed)
        mu, drop = random.uniform(0.2, 1.0), 10 ** random.uniform(-1, 1)
        bodies = {
            "wall": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [1, 0]}},
            "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}, "pose": {"y": -drop}},
            "finger": {
                "role": "robot",
                "mass": 0.1,
                "shape": {"kind": "disc", "radius": 0.02},
                "pose": {"x": 0.12},
                "motion": {"kind": "slide", "axis": [-1, 0]},
                "coordinates": {"s": {"drive": {"kind": "force", "force": "40 - 200 * t"}}},
            },
            "box": free(box(0.1, 0.1), x=0.05),
        }
        ends = (40.0 - G / (2.0 * mu)) / 200.0
        run = rw.simulate(
            scene(bodies, random, mu) | {"duration": 0.2, "step": 1e-3},
            model,
            tol=(None, 1e-3, 1e-5)[seed % 3],
        )
        told = str(run.outcome) == "unsupported" or "snaps out of its balance" in run.reason
        assert told, (seed, run.reason)
        assert run.time == pytest.approx(ends, abs=2e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [None, 1e-6])
def test_a_clip_that_snaps_without_damping_is_told(tol: float | None) -> None:
    """A load that grows presses the clip between its noses: past the greatest force nothing holds it."""
    clip = rw.load("snap").file.model_dump(exclude_unset=True)
    clip["bodies"]["clip"]["force"] = ["10 * t", 0]
    clip["bodies"]["clip"]["coordinates"]["x"]["damping"] = 0.0
    clip["bodies"]["stop"] = fixed(0.01, 0.01, x=0.018)
    greatest = 12.97  # docs/snap.md
    for step in (1e-1, 1e-2, 1e-3):
        given = {"u": 0.0, "apart": 1.0, "start": -1.4894e-3, "damping": 0.0}
        run = rw.simulate(
            clip | {"duration": 4.0}, "quasistatic-compliant", parameters=given, step=step, tol=tol
        )
        if str(run.outcome) == "unsupported":  # so long a step may end past the noses, where nothing holds it
            assert tol is None and step == 1e-1 and run.certificate is not None
        else:
            assert str(run.outcome) == "model_invalid", run.reason
            assert "clip snaps out of its balance" in run.reason
        assert run.time == pytest.approx(greatest / 10.0, abs=3.0 * step + 2e-3)
        assert run.final["clip"]["x"] < 1e-3


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [None, 1e-4])
def test_what_settles_does_not_snap(tol: float | None) -> None:
    """Soft piles sink at once, and stay."""
    for seed in range(10):
        random, top = np.random.default_rng(seed), 0.0
        bodies: dict[str, Any] = {"floor": {"role": "obstacle", "shape": {"kind": "halfplane"}}}
        for i in range(random.integers(1, 5)):
            width, height = random.uniform((0.1, 0.05), (0.3, 0.2))
            bodies[f"box{i}"] = free(box(width, height), x=random.uniform(-0.02, 0.02), y=top + 0.5 * height)
            top += height
        pile = scene(bodies, random, 0.5)
        pile["contacts"][0]["stiffness"] = 10 ** random.uniform(3.8, 5.0)
        run = rw.simulate(pile, "quasistatic-compliant", tol=tol)
        assert str(run.outcome) == "timeout", (seed, run.reason)


@pytest.mark.parametrize("seed", range(20))
def test_a_box_on_a_slope_settles_whatever_error_is_allowed(seed: int) -> None:
    """Faces turn as it settles, by more than the error that is allowed: it settles all the same, at once."""
    random = np.random.default_rng(seed)
    width, height, slope = random.uniform((0.1, 0.05, -0.3), (0.3, 0.1, 0.3))
    slide = scene(
        {"floor": fixed(9.0, 1.0, y=-0.5), "box": free(box(width, height), y=0.5 * height)},
        random,
        0.7,
        slope,
    )
    stiffness = slide["contacts"][0]["stiffness"] = 10 ** random.uniform(4, 6)
    slide["contacts"][0]["damping"] = 0.0
    sinks, tips = G / stiffness / 2.0, height * math.tan(abs(slope)) / width
    run = rw.simulate(slide, "quasistatic-compliant", tol=sinks * 10 ** random.uniform(-3, 0.5))
    assert str(run.outcome) == "timeout", run.reason
    turn = -2.0 * sinks * math.cos(slope) * tips / width * math.copysign(1.0, slope)
    assert run.final["box"]["angle"] == pytest.approx(turn, rel=0.2)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
def test_what_falls_far_below_or_beside_something_heavy_is_unsupported(seed: int) -> None:
    """Two boxes, of very different masses, on a slope on which they slide or topple: without inertia no step
    has a solution, and loads that nothing balances are why."""
    random = np.random.default_rng(seed)
    for _ in range(12):
        mu, width, low, high = random.uniform((0.05, 0.5, 0.5, 0.3), (1.0, 2.0, 2.0, 1.0))
        slope = math.atan(max(mu, width / (low + high))) * random.uniform(1.05, 1.4)
        bodies = {
            "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
            "wall": fixed(1.0, 10.0, x=10 ** random.uniform(0.7, 3)),
            "one": free(box(width, low), y=0.5 * low),
            "two": free(box(width, high), y=low + 0.5 * high) | {"mass": 10 ** random.uniform(-2, 2)},
        }
        slide = scene(bodies, random, mu, slope)
        slide["contacts"][0] |= {"stiffness": 10 ** random.uniform(4, 6), "damping": 0.0}
        run = rw.simulate(slide, "quasistatic-compliant")
        assert str(run.outcome) == "unsupported" and run.certificate is not None, run.reason


class Tip:
    """A disc on a spring k, pressed down by P, over a ridge between faces that rise by a and fall by b. At
    the edge it balances only if k R > P; else it snaps by P (tan a + tan b) / k, to the face behind."""

    def __init__(self, seed: int, stable: bool) -> None:
        random = np.random.default_rng(seed)
        size, self.step = 10 ** random.uniform((-3, -5), (2, -1))
        press, self.radius = 10 ** random.uniform(-2, 2), size * random.uniform(0.3, 1.0)
        stiff = press / self.radius * (random.uniform(1.2, 4) if stable else random.uniform(0.03, 0.4))
        least = 5e-3 * stiff * self.radius / press
        up, down = np.arctan(least * 10 ** random.uniform(0, 1.3, 2))
        self.leap = press * (math.tan(up) + math.tan(down)) / stiff
        edge = -self.radius * math.sin(up)
        sweep = self.leap * 10 ** random.uniform(-2.0, -0.5)
        steps, start = int(random.integers(20, 60)), edge - 0.5 * sweep
        self.duration, target = steps * self.step, start + press * math.tan(up) / stiff
        pace = sweep / self.duration
        ridge, far = 6.0 * (self.leap + self.radius), 3.0 * (self.leap + self.radius)
        outline = [
            [0.0, 0.0],
            [-far, -far * math.tan(up)],
            [-far, -far * math.tan(up) - ridge],
            [far, -far * math.tan(down) - ridge],
            [far, -far * math.tan(down)],
        ]
        moved: dict[str, Any] = {"role": "obstacle", "shape": {"kind": "polygon", "vertices": outline}}
        servo = {"kind": "servo", "stiffness": stiff, "damping": 0.0, "target": f"{target} + {pace} * t"}
        if random.random() < 0.5:  # the ridge is drawn the other way
            drive = {"drive": {"kind": "speed", "speed": pace}}
            servo["target"] = target
            moved |= {"role": "robot", "motion": {"kind": "slide", "axis": [-1, 0], "name": "s"}}
            moved["coordinates"] = {"s": drive}
        top = self.radius / math.cos(up) + start * math.tan(up)
        tip = {
            "role": "robot",
            "mass": 1e-3 * press,
            "shape": {"kind": "disc", "radius": self.radius},
            "pose": {"x": start, "y": top + 1e-12 * self.radius},
            "motion": {"kind": "free"},
            "coordinates": {"x": {"drive": servo}, "y": {"drive": {"kind": "force", "force": -press}}},
        }
        contacts = {"between": ["tip", "ridge"], "friction": 0.0}
        contacts["stiffness"] = press / self.radius * 10 ** random.uniform(3, 6)
        self.scene = {
            "name": "tip",
            "bodies": {"ridge": moved, "tip": tip},
            "contacts": [contacts],
            "step": self.step,
            "duration": self.duration,
        }


@pytest.mark.few(1)
@pytest.mark.parametrize("model", SLOW)
def test_a_spring_that_snaps_over_a_ridge_is_told_however_little_it_moves(model: str) -> None:
    for seed in range(40):
        snapping, held = Tip(seed, False), Tip(seed, True)
        run = rw.simulate(snapping.scene, model, frames=3)
        assert str(run.outcome) == "model_invalid", (seed, snapping.leap / snapping.radius, run.reason)
        assert "tip snaps out of its balance" in run.reason
        assert run.time == pytest.approx(0.5 * snapping.duration, abs=0.25 * snapping.duration), seed
        run = rw.simulate(held.scene, model, frames=3)
        assert str(run.outcome) == "timeout", (seed, run.reason)


@pytest.mark.few(1)
@pytest.mark.parametrize("model", SLOW)
def test_a_load_that_jumps_between_steps_is_no_snap(model: str) -> None:
    """A spring under a load that jumps at a multiple of the step, by far more than the steps before."""
    for seed in range(40):
        random = np.random.default_rng(seed)
        step, size = 10 ** random.uniform((-5, -3), (-1, 2))
        load, way = 10 ** random.uniform((-2, -2.5), (2, 0))
        jump = int(random.integers(6, 15)) * step
        spring = {"kind": "servo", "stiffness": load / (way * size), "damping": 0.0, "target": 0.0}
        slider = {
            "role": "robot",
            "mass": 1.0,
            "shape": box(size, size),
            "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
            "force": [f"{load} if t {random.choice(['>', '>='])} {jump} else 0", 0],
            "coordinates": {"s": {"drive": spring}},
        }
        run = rw.simulate(
            {
                "name": "jump",
                "bodies": {"slider": slider},
                "contacts": [],
                "step": step,
                "duration": 20 * step,
            },
            model,
        )
        assert str(run.outcome) == "timeout", (seed, run.reason)
        assert run.final["slider"]["s"] == pytest.approx(way * size)
