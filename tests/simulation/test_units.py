"""A scene in other units does the same, bit for bit: no number with a unit is hidden.

Units are powers of four, by which multiplication is exact and the square root, too. By powers of ten every
number is rounded, and a run may go another way if rounding alone makes it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.planar.state.workspace import recorded as memory
from rungwise.simulation.result import Run
from rungwise.simulation.run import Simulation

from . import scaling
from .conftest import MOVING
from .random_scenes import random_scene
from .scaling import Units, differing, recorded, scaled

MOST = 10
"""Greatest power of four."""
TURNS = 15
"""Steps of each run."""
FAR = (
    Units(4.0**MOST),
    Units(4.0**-MOST),
    Units(1, 4.0**MOST, 4.0**-MOST),
    Units(4.0**-7, 4.0**-MOST, 4.0**6),
)


def taken(
    scene: rw.Scene, model: rw.Rung, tol: float | None, units: Units, turns: int = TURNS, **options: Any
) -> Run:
    """The scene's first steps in other units."""
    there = rw.load(scaled(scene, units))
    allowed = None if tol is None else tol * units.length
    simulation = Simulation(there, model, tol=allowed, stride=1, frames=turns + 2, **options)
    simulation.advance(turns)
    return simulation.result()


def drawn(rng: np.random.Generator, base: float, most: int) -> Units:
    return Units(*(base ** int(power) for power in rng.integers(-most, most + 1, 3)))


def box(width: float, height: float, x: float, y: float, **more: Any) -> dict[str, Any]:
    shape = {"kind": "box", "width": width, "height": height}
    return {"role": "object", "shape": shape, "pose": {"x": x, "y": y}, "motion": {"kind": "free"}} | more


def driven(shape: dict[str, Any], x: float, y: float, speed: Any, axis: float = 1.0) -> dict[str, Any]:
    coordinate = {"upper": 0.6, "drive": {"kind": "speed", "speed": speed}}
    return {
        "role": "robot", "shape": shape, "pose": {"x": x, "y": y}, "mass": 1,
        "motion": {"kind": "slide", "axis": [axis, 0.0], "name": "x"}, "coordinates": {"x": coordinate},
    }  # fmt: skip


def pushed(height: float) -> dict[str, Any]:
    """A box on a floor, pushed by a finger: it slides, or high up tips."""
    return {
        "name": "pushed", "gravity": [0, -9.81], "duration": 1, "tolerance": 1e-6,
        "bodies": {
            "box": box(0.2, 0.4, 0.0, 0.2, mass=1),
            "finger": driven({"kind": "point"}, -0.1, height, 0.05),
            "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
        },
        "contacts": [{"between": ["box", "floor"], "friction": 0.5}, {"between": ["finger", "box"]}],
    }  # fmt: skip


def squeezed(mu: float) -> dict[str, Any]:
    """A disc between two walls that close at an angle: held, or thrown out."""
    walls = {
        name: driven({"kind": "halfplane", "normal": [-side, 0.36]}, side * 1.08, 0.0, 0.4, -side)
        for name, side in (("left", -1.0), ("right", 1.0))
    }
    disc = {"role": "object", "shape": {"kind": "disc", "radius": 1}, "mass": 1, "motion": {"kind": "free"}}
    contacts = [{"between": ["disc", "*"], "friction": mu}]
    return {
        "name": "squeezed",
        "bodies": walls | {"disc": disc},
        "contacts": contacts,
        "step": 1e-2,
        "duration": 5,
    }


def slabs() -> dict[str, Any]:
    """A box that slides over flush slabs, rubbed by its support besides."""
    bodies = {
        f"slab{k}": {"role": "obstacle", "shape": {"kind": "box", "width": 1, "height": 0.2, "at": [k, -0.1]}}
        for k in range(2)
    }
    rubbed = {
        "x": {"speed": 2, "dry_friction": 0.3}, "y": {"dry_friction": 0.3}, "angle": {"dry_friction": 0.01},
    }  # fmt: skip
    bodies["box"] = box(0.2, 0.1, 0.38, 0.05, mass=1, coordinates=rubbed)
    contacts = [{"between": ["box", "slab*"], "friction": 0.2, "damping": 1e3}]
    return {"name": "slabs", "gravity": [0, -9.81], "bodies": bodies, "contacts": contacts, "duration": 1}


def thrown(mu: float) -> dict[str, Any]:
    """A rod thrown at a floor."""
    rod = {
        "role": "object", "shape": [{"kind": "point", "at": [side, 0]} for side in (-0.5, 0.5)], "mass": 1,
        "centre": [0, 0], "inertia": 1 / 12, "pose": {"x": 0, "y": 0.36, "angle": 0.8},
        "motion": {"kind": "free"},
        "coordinates": {"y": {"speed": -2}, "angle": {"speed": 0.3}},
    }  # fmt: skip
    floor = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    contacts = [{"between": ["rod", "floor"], "friction": mu, "restitution": 0.5}]
    return {"name": "thrown", "bodies": {"rod": rod, "floor": floor}, "contacts": contacts, "duration": 0.02}


def linkage() -> dict[str, Any]:
    """Two driven links that run into a stop."""
    links = {
        name: {
            "role": "robot", "shape": {"kind": "capsule", "length": 0.9, "radius": 0.02}, "mass": 1,
            "pose": {"x": x}, "motion": {"kind": "free"},
        }
        for name, x in (("upper", 0.5), ("lower", 1.5))
    }  # fmt: skip
    base = {"role": "obstacle", "shape": {"kind": "point"}}
    stop = {
        "role": "obstacle",
        "shape": {"kind": "box", "width": 0.3, "height": 0.3},
        "pose": {"x": 1.2, "y": 0.175},
    }
    turn = {"drive": {"kind": "speed", "speed": 0.5}}
    return {
        "name": "linkage", "bodies": {"base": base, "stop": stop} | links, "duration": 3,
        "joints": {
            "shoulder": {"kind": "hinge", "between": ["base", "upper"], "at": [0, 0], "coordinate": turn},
            "elbow": {"kind": "hinge", "between": ["upper", "lower"], "at": [1, 0], "coordinate": turn},
        },
        "contacts": [{"between": ["*", "stop"], "friction": 0.3, "stiffness": 1e4, "damping": 10}],
    }  # fmt: skip


ORDINARY = {
    "slid": pushed(0.05), "tipped": pushed(0.3), "held": squeezed(0.5), "ejected": squeezed(0.2),
    "slabs": slabs(), "thrown": thrown(0.5), "linkage": linkage(),
}  # fmt: skip
SCENES = {name: rw.load(name) for name in rw.shipped()} | {
    name: rw.load(data) for name, data in ORDINARY.items()
}


@pytest.mark.few(2)
@pytest.mark.parametrize("tol", [None, 1e-3], ids=["fixed", "controlled"])
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("name", SCENES)
def test_ordinary_scenes(name: str, model: rw.Rung, tol: float | None) -> None:
    scene = SCENES[name]
    here = recorded(taken(scene, model, tol, Units(), 60), Units())
    for units in FAR:
        there = recorded(taken(scene, model, tol, units, 60), units)
        assert not differing(here, there), units


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 40, 10))
def test_random_scenes(first: int) -> None:
    for number in range(first, first + 10):
        scene, rng = rw.load(random_scene(number)), np.random.default_rng([number, 1])
        for k, model in enumerate(MOVING):
            tol, units = (None, 1e-3)[(number + k) % 2], drawn(rng, 4.0, MOST)
            here, there = taken(scene, model, tol, Units()), taken(scene, model, tol, units)
            wrong = differing(recorded(here, Units()), recorded(there, units))
            assert not wrong, (number, model.name, tol, units)


@pytest.mark.long
def test_random_scenes_run() -> None:
    """On every rung at least half of the scenes go on for several steps; in some, bodies push each other."""
    for model in MOVING:
        runs = [taken(rw.load(random_scene(number)), model, None, Units()) for number in range(0, 200, 10)]
        long = [run for run in runs if run.steps > 5]
        touching = [run for run in long if run.workspace is not None and memory(run.workspace, "modes").any()]
        assert len(long) >= 10 and len(touching) >= 3, (model.name, len(long), len(touching))


SETTLED = 1e-11
"""What rounding may do to a run that powers of ten are to leave as it is."""
SAME = 1e-9


def apart(one: dict[str, Any], two: dict[str, Any]) -> float:
    """Greatest distance of two reports: places in the size of the bodies, speeds beside the fastest."""
    if any(one[name] != two[name] for name in ("outcome", "steps")) or one.keys() != two.keys():
        return np.inf
    if "q" not in one:
        return 0.0
    fastest = float(np.abs(one["v"]).max(initial=1e-12))
    sizes = {"q": 0.1, "deformation": 0.1, "v": fastest}
    return max(float(np.abs(one[name] - two[name]).max(initial=0.0)) / size for name, size in sizes.items())


def test_powers_of_ten() -> None:
    """In units near one, which round every number but hide nothing, a run shows what rounding does to it."""
    settled = 0
    for number in range(0, 200, 32):
        scene, rng = rw.load(random_scene(number)), np.random.default_rng([number, 2])
        model = MOVING[number % len(MOVING)]
        here = recorded(taken(scene, model, None, Units()), Units())
        near = [Units(*(float(x) for x in rng.uniform(0.6, 1.7, 3))) for _ in range(4)]
        if max(apart(here, recorded(taken(scene, model, None, units), units)) for units in near) > SETTLED:
            continue
        settled += 1
        units = drawn(rng, 10.0, 9)
        assert apart(here, recorded(taken(scene, model, None, units), units)) <= SAME, (
            number,
            model.name,
            units,
        )
    assert settled > 4


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_batch(model: rw.Rung) -> None:
    units, points = FAR[3], np.linspace([0.5, 0.1], [1.5, 0.9], 6)
    options: dict[str, Any] = {"over": ("v2", "mu"), "threads": 1}
    scenes = [rw.load(scaled(SCENES["two_finger_free"], own)) for own in (Units(), units)]
    here = rw.Batch(scenes[0], model, tol=1e-2, **options).run(points)
    there = rw.Batch(scenes[1], model, tol=1e-2 * units.length, **options).run(points)
    assert np.array_equal(here.outcome, there.outcome) and np.array_equal(here.steps, there.steps)
    places = np.array([units.factor(place) for place in scaling.places(SCENES["two_finger_free"]).values()])
    assert np.array_equal(here.final, there.final / places)
    assert np.array_equal(here.time, there.time / units.time)


def test_tolerance_out_of_proportion_is_told() -> None:
    for tolerance, told in ((1e-6, 0), (1e-12, 1), (0.1, 1)):
        run = rw.simulate(pushed(0.05) | {"tolerance": tolerance, "duration": 2e-3}, rw.DYNAMIC_RIGID)
        assert sum(note.startswith("tolerance") for note in run.notes) == told


@pytest.mark.parametrize("length", [1e-5, 3e4, 1e5])
def test_a_default_tolerance_neither_sinks_nor_hangs(length: float) -> None:
    """On the quasistatic rung the motion is similar at every length, whatever the tolerance."""
    there = scaled(rw.load(pushed(0.05)), Units(length)) | {"tolerance": 1e-6, "gravity": [0, -9.81]}
    runs = [rw.simulate(scene, rw.QUASISTATIC_RIGID, duration=0.05) for scene in (pushed(0.05), there)]
    places = [list(run.final["box"].values()) for run in runs]
    assert runs[0].steps == runs[1].steps == 50
    assert np.array(places[1]) / [length, length, 1.0] == pytest.approx(places[0], abs=1e-9)
