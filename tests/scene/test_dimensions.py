"""A parameter's unit has the dimension of every place that the parameter feeds, or is refused in a line."""

from __future__ import annotations

from typing import Any

import pytest

import rungwise as rw
from rungwise.scene.language.units import measured

UNITS = ("m", "s", "kg", "N", "rad", "m/s", "N/m", "N*s/m", "kg*m^2", "m/s^2")
SLIDE = {"kind": "slide", "axis": [1, 0], "name": "x"}
SERVO = {"kind": "servo", "stiffness": 1, "target": 0}
BODY: dict[str, Any] = {
    "role": "object", "mass": 1, "shape": {"kind": "box", "width": 1, "height": 1, "radius": 0, "angle": 0},
    "pose": {"x": 0, "y": 0, "angle": 0}, "motion": {"kind": "free"}, "torque": 0, "inertia": 1,
    "force": [0, 0], "density": 1, "coordinates": {"angle": {"speed": 0, "start": 0, "drive": SERVO}},
}  # fmt: skip
PLANE: dict[str, Any] = {
    "name": "any", "gravity": [0, 0], "step": 0.001, "duration": 1, "tolerance": 1e-6,
    "bodies": {
        "b": BODY,
        "c": BODY | {"pose": {"x": 9}, "motion": SLIDE, "coordinates": {"x": {"drive": SERVO, "start": 0}}},
    },
    "contacts": [{"between": ["b", "c"], "friction": 0.5, "restitution": 0, "stiffness": 1e6, "damping": 1}],
}  # fmt: skip
SPACE: dict[str, Any] = {
    "name": "any", "model": {"file": "floor_push.xml", "set": {"option": {"gravity": [0, 0, -9.81]}}},
    "start": {"places": {"box.x": 0}, "velocities": {"box.x": 0, "box.rz": 0}}, "duration": 1, "step": 0.001,
    "contacts": [{"friction": 0.5, "stiffness": 1e5, "damping": 10, "restitution": 0}],
}  # fmt: skip


def with_parameter(node: Any, path: str = "") -> list[tuple[str, Any]]:
    """The content with the parameter a in place of each number, and where."""
    found: list[tuple[str, Any]] = []
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        here = f"{path}.{key}" if path else str(key)
        if isinstance(value, dict | list):
            inner = with_parameter(value, here)
        else:
            inner = [(here, "a")] if isinstance(value, int | float) else []
        for where, changed in inner:
            copy = dict(node) if isinstance(node, dict) else list(node)
            copy[key] = changed
            found.append((where, copy))
    return found


CASES = [(where, data) for whole in (PLANE, SPACE) for where, data in with_parameter(whole)]


@pytest.mark.few(10)
@pytest.mark.parametrize(("where", "data"), CASES, ids=[where for where, _ in CASES])
def test_units_of_another_dimension_are_refused_at_every_place(where: str, data: dict[str, Any]) -> None:
    if "axis" in where:
        return
    fits = set()
    for unit in UNITS:
        given = data | {"parameters": {"a": {"default": 0.001, "unit": unit}}}
        try:
            rw.load(given)
        except rw.SceneError as error:
            assert str(error).startswith(
                f"parameters.a.unit: {unit} does not fit where a is used: {where} is a"
            )
            assert "\n" not in str(error)
        else:
            fits.add(measured(unit).powers)
    assert len(fits) <= 1


def pushed(**units: str) -> dict[str, Any]:
    file: dict[str, Any] = rw.load("push").file.model_dump(mode="json", exclude_unset=True)
    for name, unit in units.items():
        file["parameters"][name]["unit"] = unit
    return file


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"width": "s"}, "parameters.width.unit: s does not fit where width is used: bodies.box.shape.width"),
        (
            {"mu": "deg"},
            "parameters.mu.unit: deg does not fit where mu is used: contacts.0.friction is a ratio",
        ),
        (
            {"v": "m"},
            "duration: 'travel / v' is in rad or 1, but duration is a time, in s (parameters.travel",
        ),
        (
            {"goal_x": "s"},
            "goal: 'box.x' is in m, and 'goal_x' in s; what is added or compared must have one",
        ),
    ],
)
def test_expressions_and_conditions(units: dict[str, str], message: str) -> None:
    with pytest.raises(rw.SceneError) as error:
        rw.load(pushed(**units))
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("target", ["2 * t", "0.5 * t + a", "a + t"])
def test_numbers_without_a_unit_may_have_any(target: str) -> None:
    """As the rate of 2 rad/s in ``2 * t``."""
    turns = {"angle": {"drive": SERVO | {"target": target}}}
    parameters = {"a": {"default": 0.1, "unit": "rad"}}
    rw.load(
        PLANE | {"bodies": {"b": BODY | {"coordinates": turns}}, "contacts": [], "parameters": parameters}
    )


@pytest.mark.parametrize("goal", ["exp(-b.x) <= 1e-12", "b.x + b.angle <= 1", "b.x * b.y >= a"])
def test_conditions_without_a_parameter_with_a_unit_may_mix(goal: str) -> None:
    rw.load(PLANE | {"goal": goal, "parameters": {"a": {"default": 1, "unit": "1"}}})


def test_a_parameter_that_feeds_places_of_two_dimensions() -> None:
    data = {**PLANE, "parameters": {"a": {"default": 1.0, "unit": "m"}}, "duration": "a"}
    data["bodies"] = {"b": BODY | {"shape": {"kind": "disc", "radius": "a"}}}
    data["contacts"] = []
    with pytest.raises(
        rw.SceneError, match=r"duration is a time, in s; it fits bodies\.b\.shape\.radius: take"
    ):
        rw.load(data)


@pytest.mark.parametrize(
    ("read", "is_told"),
    [
        ("2 * a", True), ("-a", True), ("a + 1", True), ("max(a, 0.1)", True), ("hypot(a, a)", True),
        ("a if a > 0 else 1", True), ("sqrt(a * a)", True), ("abs(a) / 2", True), ("b * a", True),
        ("3.7 * a", False), ("a / 1", False), ("a * c", False), ("a ** 1000", False), ("7", False),
    ],
)  # fmt: skip
def test_what_is_told_of_an_expression(read: str, is_told: bool) -> None:
    """A number that multiplies may have a unit; halves and doubles have none, and b is a ratio."""
    parameters = {
        name: {"default": 1.0, "unit": unit} for name, unit in (("a", "s"), ("b", "rad"), ("c", "1"))
    }
    data = {**PLANE, "parameters": parameters, "contacts": []}
    data["bodies"] = {"b": BODY | {"shape": {"kind": "disc", "radius": read}}}
    try:
        rw.load(data)
    except rw.SceneError as error:
        assert (
            is_told
            and str(error).startswith("bodies.b.shape.radius: ")
            and " is a length, in m" in str(error)
        )
    else:
        assert not is_told


def test_degrees_in_a_product_of_angles() -> None:
    assert rw.load(pushed(angle="deg")).parameters()


@pytest.mark.parametrize(
    ("read", "message"),
    [
        ("sqrt(a * a)", ""), ("sqrt(a) ** 2", ""), ("a * sin(b)", ""), ("a * exp(a / a)", ""),
        ("sqrt(a)", "bodies.b.shape.radius: 'sqrt(a)' is in m^0.5"),
        ("a * sin(a)", "bodies.b.shape.radius: 'a' is in m, where an angle or a ratio is needed"),
        ("a * log(b * a)", "bodies.b.shape.radius: 'b * a' is in m, where an angle or a ratio is needed"),
    ],
)  # fmt: skip
def test_roots_and_functions_of_angles(read: str, message: str) -> None:
    parameters = {name: {"default": 1.5, "unit": unit} for name, unit in (("a", "m"), ("b", "rad"))}
    data = {**PLANE, "parameters": parameters, "contacts": []}
    data["bodies"] = {"b": BODY | {"shape": {"kind": "disc", "radius": read}}}
    if not message:
        rw.load(data)
        return
    with pytest.raises(rw.SceneError) as error:
        rw.load(data)
    assert str(error.value).startswith(message)
