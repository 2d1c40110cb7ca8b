"""Scenes built in Python are the scenes of the files; arithmetic on parameters is that of the file."""

from __future__ import annotations

import inspect
import math
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import rungwise as rw
from rungwise.scene.builder import builder as draft
from rungwise.scene.builder import parts
from rungwise.scene.builder.symbol import Symbol
from rungwise.scene.fields import fields, shapes


def gripper() -> rw.SceneBuilder:
    """The shipped scene."""
    file = rw.load("gripper").file
    s = rw.SceneBuilder("gripper", about=file.about, tolerance=1e-8)
    given: dict[str, Any] = {}
    for name, p in file.parameters.items():
        given[name] = s.parameter(
            name, p.default, range=p.range, unit=p.unit, about=p.about, is_input=name in file.inputs
        )
    squeeze, mu, mass, gravity, v, lift = list(given.values())[:6]
    s.gravity = [0, -gravity]
    for name, side in (("left", 1), ("right", -1)):
        s.body(
            name,
            "robot",
            parts.box(0.01, 0.03),
            pose=(-0.025 * side, 0.03),
            motion=parts.free(),
            mass=0.2 * mass,
            coordinates={
                "x": parts.force(squeeze if side > 0 else -squeeze),
                "y": parts.coordinate(drive=parts.speed(v)),
                "angle": parts.speed(0),
            },
        )
    s.body("part", "object", parts.box(0.04, 0.06), pose={"y": 0.03}, motion=parts.free(), mass=mass)
    s.body("floor", "obstacle", parts.halfplane())
    s.contact("*", "part", friction=mu, stiffness=given["stiffness"], damping=given["damping"])
    s.goal = f"gap(part, floor) >= {lift}"
    s.duration, s.step = 2 * lift / v, 1e-3 * lift / v
    return s


def same(one: rw.Scene, other: rw.Scene) -> bool:
    """Whether both mean the same: all numbers, whatever is stated and whatever is left to defaults."""
    (a, b), (c, d) = ((scene.template, scene.bind().buffer) for scene in (one, other))
    return bool(np.array_equal(b, d)) and (a.coordinates, a.contacts, a.inputs) == (
        c.coordinates, c.contacts, c.inputs
    )  # fmt: skip


def test_a_built_scene_is_the_scene_of_the_file() -> None:
    assert same(gripper().load(), rw.load("gripper"))
    assert gripper().load().file.goal == rw.load("gripper").file.goal
    assert gripper().data()["duration"] == "2 * lift / v"


@pytest.mark.few(6)
@pytest.mark.parametrize("name", rw.shipped())
def test_scenes_as_text_are_the_scenes(name: str, tmp_path: Path) -> None:
    scene = rw.load(name)
    file = tmp_path / "scene.yaml"
    file.write_text(scene.yaml(), "utf-8")
    assert rw.load(file).file == scene.file


def test_a_built_scene_is_saved_as_a_file(tmp_path: Path) -> None:
    gripper().save(tmp_path / "mine.yaml")
    assert same(rw.load(tmp_path / "mine.yaml"), rw.load("gripper"))
    assert rw.simulate(tmp_path / "mine.yaml", "quasistatic-rigid").outcome == "goal"


def test_all_kinds_have_a_function_with_the_fields_of_the_file() -> None:
    unions = (shapes.Shape, fields.Motion, fields.Drive, fields.Pressure)
    models = [model for union in unions for model in get_args(get_args(union)[0])]
    for model in models:
        kind = get_args(model.model_fields["kind"].annotation)[0]
        given = list(inspect.signature(getattr(parts, kind)).parameters)
        assert sorted(given) == sorted(set(model.model_fields) - {"kind"}), kind
    for function, model in ((parts.coordinate, fields.Coordinate), (parts.support, fields.Support)):
        assert sorted(inspect.signature(function).parameters) == sorted(model.model_fields)


@pytest.mark.parametrize(
    ("method", "model", "other"),
    [
        ("parameter", fields.Parameter, {"name", "is_input"}),
        ("body", fields.Body, {"name"}),
        ("joint", fields.Joint, {"name"}),
        ("contact", fields.Contact, {"one", "other"}),
        ("potential", fields.Potential, set()),
        ("__init__", fields.SceneFile, set()),
    ],
)
def test_methods_have_the_fields_of_the_file(method: str, model: Any, other: set[str]) -> None:
    given = set(inspect.signature(getattr(draft.SceneBuilder, method)).parameters) - {"self"} - other
    made = {"between"} if method == "contact" else set()
    if method == "__init__":
        made = {"parameters", "inputs", "bodies", "joints", "contacts", "potentials"}
    assert given | made == set(model.model_fields)


@pytest.mark.few(7)
@pytest.mark.parametrize("seed", range(20))
def test_arithmetic_on_parameters_is_that_of_the_file(seed: int) -> None:
    """Random expressions, with Python's own arithmetic beside the scene's."""
    rng = np.random.default_rng(seed)
    numbers = {"a": 1.7, "b": 0.6, "c": 2.3}

    def grown(depth: int) -> tuple[Any, Any]:
        if depth == 0:
            if rng.random() < 0.3:
                value = round(float(rng.uniform(-2, 2)), 3)
                return value, value
            name = str(rng.choice(list(numbers)))
            return Symbol(name), numbers[name]
        (x, u), (y, w) = grown(depth - 1), grown(int(rng.integers(depth)))
        match rng.integers(6):
            case 0:
                return x + y, u + w
            case 1:
                return x - y, u - w
            case 2:
                return x * y, u * w
            case 3 if abs(w) > 1e-3:
                return x / y, u / w
            case 4 if isinstance(x, Symbol):
                return x**2, u**2
        return -x, -u  # fmt: skip

    for _ in range(20):
        text, value = grown(4)
        s = rw.SceneBuilder("a", gravity=(text, 0))
        for name, number in numbers.items():
            s.parameter(name, number)
        s.body("a", "object", parts.disc(1.0), motion=parts.free())
        found = float(s.load().bind().records.world[0]["gravity_x"])
        assert math.isclose(found, value, rel_tol=1e-9, abs_tol=1e-12), (text, found, value)


def test_wrong_parts_are_told_with_their_place() -> None:
    s = rw.SceneBuilder("a")
    s.body("a", "object", parts.box(1.0, -1.0), motion=parts.free())
    with pytest.raises(rw.SceneError, match=r"^bodies\.a\.shape\.height: -1 must be > 0"):
        s.load()
    with pytest.raises(rw.SceneError, match=r"^bodies\.a: 'a' is given twice$"):
        s.body("a", "object", parts.disc(1.0))
    with pytest.raises(rw.KeywordError, match=r"box: unknown keyword 'widht' \(did you mean width\?\)"):
        parts.box(widht=1.0, height=1.0)  # type: ignore[call-arg]
    with pytest.raises(rw.SceneError, match=r"^bodies\.b\.role: must be"):
        other = rw.SceneBuilder("b")
        other.body("b", "tool", parts.disc(1.0))
        other.load()
    with pytest.raises(rw.SceneError, match=r"^bodies: "):
        rw.SceneBuilder("c").load()
