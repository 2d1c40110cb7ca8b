"""Every kind of error in every kind of field: one line that names the field and lists what is valid."""

from __future__ import annotations

import copy
import math
import types
from collections import OrderedDict
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

from rungwise.scene import InvalidScene, SceneError, load, shipped
from rungwise.scene.fields import fields, shapes, task, values


def lying(x: float, support: dict[str, Any]) -> dict[str, Any]:
    """A disc on a plane."""
    return {
        "role": "object",
        "shape": {"kind": "disc", "radius": 0.1},
        "pose": {"x": x},
        "motion": {"kind": "free"},
        "support": support,
    }


WHOLE: dict[str, Any] = {
    "name": "whole",
    "about": "every part of a scene, with every field",
    "parameters": {
        "p": {"default": 0.5, "range": [0.0, 1.0], "unit": "N*s/m", "about": "any"},
        "u": {"default": 0.5},
    },
    "units": {"length": "m", "mass": "kg", "time": "s"},
    "inputs": ["u"],
    "gravity": [0.0, -9.81],
    "bodies": {
        "tip": {
            "role": "robot",
            "shape": {"kind": "point", "at": [0.0, 0.0]},
            "pose": {"x": 0.0, "y": 9.0, "angle": 0.0},
            "motion": {"kind": "slide", "axis": [0.0, -1.0], "name": "s"},
            "coordinates": {
                "s": {
                    "start": 0.0,
                    "speed": 0.0,
                    "lower": 0.0,
                    "upper": 1.0,
                    "damping": 0.0,
                    "dry_friction": 0.0,
                    "drive": {"kind": "speed", "speed": "p"},
                }
            },
            "mass": 1.0,
            "density": 1.0,
            "centre": [0.0, 0.0],
            "inertia": 1.0,
            "force": ["u", "u"],
            "torque": "u",
            "raised": "u",
        },
        "arm": {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.1, "at": [0.0, 0.0]},
            "pose": {"x": -9.0},
            "motion": {"kind": "hinge", "pivot": [-9.0, 1.0], "name": "turn"},
            "coordinates": {
                "turn": {
                    "drive": {
                        "kind": "servo",
                        "stiffness": 1.0,
                        "damping": 1.0,
                        "target": "p * t",
                        "target_speed": 0.0,
                        "limit": 5.0,
                    }
                }
            },
        },
        "part": {
            "role": "object",
            "shape": {
                "kind": "box",
                "width": 1.0,
                "height": 1.0,
                "radius": 0.1,
                "at": [0.0, 0.0],
                "angle": 0.0,
            },
            "motion": {"kind": "free"},
            "coordinates": {"x": {"drive": {"kind": "force", "force": 1.0}}},
            "support": {
                "friction": 0.5,
                "load": 9.81,
                "pressure": {"kind": "uniform"},
                "centre": [0.0, 0.1],
                "limit_surface": "ellipsoid",
            },
        },
        "cup": lying(30.0, {"friction": 0.5, "gravity": 9.81, "pressure": {"kind": "ring", "radius": 0.1}}),
        "stool": lying(
            40.0,
            {
                "friction": 0.5,
                "load": 9.81,
                "pressure": {"kind": "points", "points": [[0.1, 0.0], [-0.1, 0.0]], "weights": [1.0, 2.0]},
            },
        ),
        "ball": lying(50.0, {"friction": 0.5, "load": 9.81, "pressure": {"kind": "ratio", "ratio": 0.1}}),
        "wedge": {
            "role": "obstacle",
            "shape": {
                "kind": "polygon",
                "vertices": [[8.0, 0.0], [9.0, 0.0], [8.0, 1.0]],
                "radius": 0.0,
                "at": [0.0, 0.0],
                "angle": 0.0,
            },
            "motion": {"kind": "fixed"},
        },
        "rod": {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.1},
            "pose": {"x": 70.0},
            "motion": {"kind": "free"},
        },
        "palm": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [0.0, 1.0], "at": [0.0, -5.0]}},
        "cross": {
            "role": "obstacle",
            "shape": [
                {"kind": "capsule", "length": 1.0, "radius": 0.1, "at": [-20.0, 0.0], "angle": 0.0},
                {"kind": "point", "at": [-20.0, 1.0]},
                {
                    "kind": "regular",
                    "corners": 6,
                    "reach": 0.5,
                    "radius": 0.0,
                    "at": [-25.0, 0.0],
                    "angle": 0.0,
                },
                {
                    "kind": "outline",
                    "vertices": [[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [0.0, 2.0]],
                    "holes": [[[0.2, 0.2], [0.4, 0.2], [0.2, 0.4]]],
                    "at": [-20.0, 2.0],
                    "angle": 0.0,
                },
            ],
        },
    },
    "joints": {
        "pin": {
            "kind": "slide",
            "between": ["palm", "part"],
            "at": [0.0, 0.0],
            "axis": [1.0, 0.0],
            "stiffness": 1e3,
            "damping": 1.0,
            "angular_stiffness": 1e3,
            "angular_damping": 1.0,
            "coordinate": {
                "lower": -1.0,
                "upper": 1.0,
                "damping": 0.1,
                "dry_friction": 0.1,
                "drive": {"kind": "force", "force": "p * t"},
            },
        }
    },
    "contacts": [
        {
            "between": ["part", "*"],
            "friction": 0.5,
            "restitution": 0.1,
            "stiffness": 1e6,
            "damping": 1.0,
            "tangential_stiffness": 1e6,
            "tangential_damping": 1.0,
            "coupling_stiffness": 1e3,
            "coupling_damping": 0.0,
            "static_friction": 0.6,
            "yield_speed": 1.0,
            "adhesion": 1.0,
            "adhesion_range": 1e-6,
            "impact": "poisson",
        }
    ],
    "potentials": [{"stiffness": 1.0, "terms": {"tip.s": 1.0}, "target": 0.0, "on": ["tip.s"]}],
    "goal": "part.x >= 1",
    "unsafe": "t > 9",
    "doomed": "t > 10",
    "tolerance": 1e-6,
    "duration": 1.0,
    "step": 1e-2,
    "task": {
        "instances": {"p": {"uniform": [0.1, 0.9]}},
        "where": "p < 2",
        "uncertain": {"p": {"normal": [0.5, 0.1]}},
        "inputs": {"u": {"range": [0.0, 1.0], "rate": 10.0}},
        "transit": {"rod": {"speed": 1.0, "clearance": 0.1, "push": [0.1, 1.0], "lean": 0.5}},
        "fingers": {
            "ro*": {
                "speed": 1.0,
                "clearance": 0.1,
                "press": [0.1, 1.0],
                "within": {"x": [-1.0, 1.0]},
                "contacts": 1.0,
                "reserve": 0.1,
                "objects": ["pa*"],
                "over": False,
            }
        },
        "keep_out": ["part.x < -9"],
        "moves": [1, 2],
        "duration": [0.1, 1.0],
        "weights": {"part.x": 1.0},
        "cost": {"time": 1.0, "work": 1.0, "moves": 1.0},
        "reserve": 0.1,
    },
}

Path = tuple[str | int, ...]
FLAG, NUMBER, COUNT, FINITE, UNIT, NAME, TEXT, CONDITION, CHOICE, MODEL, MANY, TABLE = (
    "flag",
    "number",
    "count",
    "finite",
    "unit",
    "name",
    "text",
    "condition",
    "choice",
    "model",
    "many",
    "table",
)
PLAIN = {
    values.Number: NUMBER,
    values.Finite: FINITE,
    values.Unit: UNIT,
    values.Name: NAME,
    values.Flag: FLAG,
}
OPTIONAL = ("drive", "coordinate", "support", "task", "press", "units")
CONDITIONS = ("goal", "unsafe", "doomed", "where")


def put(path: Path, value: object) -> dict[str, Any]:
    """A copy of the whole scene with `value` at `path`."""
    scene = copy.deepcopy(WHOLE)
    at(scene, path[:-1])[path[-1]] = value
    return scene


def at(scene: Any, path: Path) -> Any:
    for part in path:
        scene = scene[part]
    return scene


def parts(annotation: Any, path: Path) -> Iterator[tuple[Path, str, Any]]:
    """All places under `path` that the models describe and the whole scene fills: path, kind, more of it."""
    value = at(WHOLE, path)
    if annotation in PLAIN:
        yield path, PLAIN[annotation], None
        return
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        yield from parts(next(a for a in arguments if suits(a, value)), path)
    elif origin is Literal:
        yield path, CHOICE, arguments
    elif origin is tuple:
        yield path, MANY, None if Ellipsis in arguments else len(arguments)
        for i in range(len(value)):
            yield from parts(arguments[0 if Ellipsis in arguments else i], (*path, i))
    elif origin is dict:
        yield path, TABLE, None
        for key in value:
            yield from parts(arguments[1], (*path, key))
    elif annotation is int:
        yield path, COUNT, None
    elif annotation is str:
        yield path, CONDITION if path[-1] in CONDITIONS or "keep_out" in path else TEXT, None
    else:
        yield path, MODEL, annotation
        for name, field in annotation.model_fields.items():
            if name in value:
                whole = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
                yield from parts(whole, (*path, name))


def suits(annotation: Any, value: Any) -> bool:
    """Whether `value`, which is right, is meant by this branch of a union."""
    if annotation is type(None):
        return value is None
    if annotation in (values.Number, values.Finite):
        return isinstance(value, int | float | str)
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    if get_origin(annotation) in (Union, types.UnionType):
        return any(suits(a, value) for a in get_args(annotation))
    if get_origin(annotation) is tuple:
        return isinstance(value, list)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        kind = annotation.model_fields.get("kind")
        return isinstance(value, dict) and (kind is None or get_args(kind.annotation) == (value.get("kind"),))
    return isinstance(value, annotation)


PARTS = list(parts(fields.SceneFile, ()))
HUGE = 10**5000
LONG = "a" * 3000
ANY = (
    True,
    False,
    3,
    math.nan,
    math.inf,
    HUGE,
    "",
    "  ",
    "foo",
    "a\nb",
    LONG,
    [],
    [1],
    [[[]]],
    {},
    {"zzz": 1},
    None,
    object(),
    b"x",
)
"""Values to put anywhere."""

WRONG: dict[str, tuple[object, ...]] = {
    FLAG: (None, 0, 1, 3.0, math.nan, "", "yes", "true", LONG, [], {}, object(), b"x"),
    COUNT: ("six", -1, 0, 10**9, 2.5, True, None, [3]),
    NUMBER: (
        True,
        False,
        math.nan,
        math.inf,
        -math.inf,
        HUGE,
        "",
        " \n",
        [],
        [1.0],
        {},
        {"x": 1},
        object(),
        b"1",
        "zzz",
        "p +",
        "p q",
        "(" * 300,
        LONG,
        "-" * 500 + "1",
        "__import__('os')",
        "__import__",
        "p.__class__",
        "().__class__",
        "p < 1",
        "p == 1",
        "p and 1",
        "not p",
        "True",
        "None",
        "'1'",
        "1j",
        "[1]",
        "p[0]",
        "p // 2",
        "lambda: 1",
        "sqrt()",
        "min(p)",
        "eval(p)",
        "a\nb",
        "9" * 500,
        "0/0",
        "log(-1)",
        "sqrt(-p)",
    ),
    FINITE: (
        None,
        True,
        math.nan,
        math.inf,
        -math.inf,
        HUGE,
        "",
        "p",
        "nan",
        "inf",
        "1e999",
        "1 + 1",
        [],
        [1.0],
        {},
        object(),
        b"1",
    ),
    UNIT: (
        None,
        True,
        3,
        "",
        "parsec",
        "m//s",
        "m/",
        "m^",
        "m s",
        "m\n",
        "1/s",
        "k",
        "m^2.5",
        "N" * 3000,
        [],
        {},
        b"m",
    ),
    NAME: (
        None,
        True,
        3,
        "",
        "1a",
        "a b",
        "a.b",
        "a\n",
        "é",
        "_a",
        "a" * 61,
        "__import__",
        "lambda",
        "if",
        "None",
        [],
        {},
        b"a",
    ),
    TEXT: (None, True, 3, 1.5, "\ud800", [], {}, object(), b"a"),
    CONDITION: (
        True,
        3,
        math.nan,
        [],
        {},
        b"t < 1",
        "",
        "1",
        "t",
        "True",
        "t < zzz",
        "t == 1",
        "t <",
        "gap(zzz, part) < 1",
        "gap(part) < 1",
        "force() < 1",
        "speed(t) < 1",
        "part.zzz < 1",
        "part < 1",
        "part.x.y < 1",
        "t < 'a'",
        "__import__('os') < 1",
        "t.__class__ < 1",
        "t in t",
        "t < (t < 1)",
        "a\nb",
        LONG,
        "t < " + "+".join("t" * 200),
    ),
    CHOICE: (None, True, 3, "", "zzz", LONG, "a\nb", [], {}, object(), b"point"),
    MODEL: (None, True, 3, math.nan, HUGE, "", "foo", LONG, 1.5, object(), b"x"),
    MANY: (
        True,
        3,
        math.nan,
        HUGE,
        "",
        "foo",
        {},
        {"x": 1},
        object(),
        b"ab",
        [None],
        [{}, {}, {}],
        [[], [], []],
    ),
    TABLE: (
        None,
        True,
        3,
        "",
        "foo",
        [],
        [1],
        {"zzz": None},
        {"zzz": []},
        {1: {}},
        {True: {}},
        {None: {}},
        {"a b": {}},
        {"a\nb": {}},
        {"": {}},
        {LONG: {}},
        {"if": {}},
    ),
}
"""Kind of a field -> what is wrong in every field of that kind."""


def label(path: Path) -> str:
    return ".".join(map(str, path)) or "scene"


def refusal(scene: object, parameters: object = None) -> str:
    with pytest.raises(SceneError) as caught:
        load(scene).bind(parameters)  # type: ignore[arg-type]
    message = str(caught.value)
    assert message.isprintable(), ascii(message)
    assert len(message) < 700
    for word in (
        "Traceback",
        "pydantic",
        "tagged-union",
        "Input should",
        "instance of",
        "function-",
        "dictionary",
    ):
        assert word not in message
    return message


def names_the_field(message: str, path: Path) -> bool:
    """The message begins with the path, or with that of something inside."""
    return message.startswith((label(path) + ":", label(path) + "."))


def test_whole_scene_is_right_and_fills_every_field_of_every_model() -> None:
    """But for drawings, which are outlines once they are read, and have tests of their own."""
    load(WHOLE).bind()
    filled = {(info, name) for path, kind, info in PARTS if kind == MODEL for name in at(WHOLE, path)}
    known = [each for module in (fields, shapes, task) for each in vars(module).values()]
    models = {m for m in known if isinstance(m, type) and issubclass(m, fields.Strict)}
    models -= {fields.Strict, shapes.Drawing}
    assert filled == {(model, name) for model in models for name in model.model_fields}


def tried(path: Path, kind: str) -> tuple[object, ...]:
    """All wrong values; of those of numbers every fourth, for there are many places to try them in."""
    if kind != NUMBER:
        return WRONG[kind]
    return WRONG[kind][[p for p, k, _ in PARTS if k == kind].index(path) % 4 :: 4]


@pytest.mark.few(11)
@pytest.mark.parametrize(
    ("path", "kind"), [(p, k) for p, k, _ in PARTS if p], ids=lambda x: label(x) if type(x) is tuple else x
)
def test_wrong_value(path: Path, kind: str) -> None:
    for value in tried(path, kind):
        if value is None and path[-1] in OPTIONAL:
            continue
        message = refusal(put(path, value))
        assert names_the_field(message, path), (value, message)


@pytest.mark.few(10)
@pytest.mark.parametrize("path", [p for p, _, _ in PARTS if p], ids=label)
def test_any_value_is_taken_or_refused_in_one_line(path: Path) -> None:
    for value in ANY:
        scene = put(path, value)
        try:
            load(scene).bind()
        except SceneError as error:
            assert str(error).isprintable()


@pytest.mark.few(7)
@pytest.mark.parametrize(
    ("path", "model"),
    [(p, m) for p, k, m in PARTS if k == MODEL],
    ids=lambda x: label(x) if type(x) is tuple else "",
)
def test_fields_missing_unknown_and_misspelt(path: Path, model: type[BaseModel]) -> None:
    for name, field in model.model_fields.items():
        scene = copy.deepcopy(WHOLE)
        part = at(scene, path)
        kept = part.pop(name, None)
        if field.is_required() or name == "kind":
            message = refusal(scene)
            assert message.startswith(f"{label((*path, name))}: is required"), message
        for wrong in (
            () if name == "kind" else (name + "s", name.upper(), LONG, "a\nb", "", 1, None, True, ("a",))
        ):
            part[wrong] = kept
            message = refusal(scene)
            assert message.startswith(f"{label(path)}: unknown field "), message
            assert f"; valid: {', '.join(model.model_fields)}" in message
            del part[wrong]


@pytest.mark.parametrize(
    ("path", "choices"), [(p, c) for p, k, c in PARTS if k == CHOICE], ids=lambda x: label(x)
)
def test_choices_are_listed(path: Path, choices: tuple[str, ...]) -> None:
    message = refusal(put(path, "zzz"))
    assert "zzz" in message and message.startswith(label(path) + ":")
    if path[-1] == "kind" and len(choices) == 1:
        unions = {
            "shape": "point disc capsule box polygon regular outline drawing halfplane",
            "motion": "fixed slide hinge free",
            "drive": "speed servo force",
            "pressure": "uniform ring points ratio",
        }
        choices = tuple(next(unions[part] for part in reversed(path) if part in unions).split())
    for choice in choices:
        assert choice in message


@pytest.mark.parametrize(
    ("path", "length"),
    [(p, n) for p, k, n in PARTS if k == MANY and n],
    ids=lambda x: label(x) if type(x) is tuple else "",
)
def test_wrong_length(path: Path, length: int) -> None:
    value = at(WHOLE, path)
    assert refusal(put(path, [])).startswith(f"{label(path)}.0: is required")
    assert refusal(put(path, value[:-1])) == f"{label((*path, length - 1))}: is required"
    assert refusal(put(path, [*value, value[0]])) == f"{label(path)}: must have at most {length}"


def test_wrong_number_of_entries() -> None:
    shape = ("bodies", "wedge", "shape", "vertices")
    assert refusal(put(shape, [[0, 0], [1, 0]])) == "bodies.wedge.shape.vertices: must have at least 3, not 2"
    assert (
        refusal(put(shape, [[i, i * i] for i in range(501)]))
        == "bodies.wedge.shape.vertices: must have at most 500"
    )
    assert refusal(put(("bodies", "cross", "shape"), [])) == "bodies.cross.shape: must have at least 1, not 0"
    assert refusal(put(("bodies",), {})) == "bodies: must have at least 1, not 0"
    assert refusal(put(("potentials", 0, "terms"), {})) == "potentials.0.terms: must have at least 1, not 0"
    point = {"kind": "point"}
    assert (
        refusal(put(("bodies", "cross", "shape"), [point] * 33)) == "bodies.cross.shape: must have at most 32"
    )


TIP, ARM, PART, WEDGE, CROSS = (("bodies", name) for name in ("tip", "arm", "part", "wedge", "cross"))
CUP, STOOL, BALL = (("bodies", name, "support") for name in ("cup", "stool", "ball"))
SERVO = (*ARM, "coordinates", "turn", "drive")
POSITIVE: tuple[Path, ...] = (
    ("tolerance",),
    ("duration",),
    ("step",),
    (*ARM, "shape", "radius"),
    (*PART, "shape", "width"),
    (*PART, "shape", "height"),
    (*CROSS, "shape", 0, "length"),
    (*CROSS, "shape", 0, "radius"),
    ("contacts", 0, "stiffness"),
    ("contacts", 0, "tangential_stiffness"),
    (*CUP, "pressure", "radius"),
)
NOT_NEGATIVE: tuple[Path, ...] = (
    (*PART, "shape", "radius"),
    (*WEDGE, "shape", "radius"),
    (*TIP, "mass"),
    (*TIP, "inertia"),
    (*TIP, "density"),
    (*TIP, "coordinates", "s", "damping"),
    (*TIP, "coordinates", "s", "dry_friction"),
    (*SERVO, "stiffness"),
    (*SERVO, "damping"),
    (*SERVO, "limit"),
    ("contacts", 0, "friction"),
    ("contacts", 0, "restitution"),
    ("contacts", 0, "damping"),
    ("contacts", 0, "tangential_damping"),
    ("potentials", 0, "stiffness"),
    (*PART, "support", "friction"),
    (*PART, "support", "load"),
    (*CUP, "gravity"),
    (*STOOL, "pressure", "weights", 0),
    (*BALL, "pressure", "ratio"),
)


@pytest.mark.parametrize("path", POSITIVE + NOT_NEGATIVE, ids=label)
@pytest.mark.parametrize("value", [-1, -1e-300, "-p", "p - 1", 0, "p - p"], ids=str)
def test_negative_and_zero(path: Path, value: object) -> None:
    if value in (0, "p - p") and path in NOT_NEGATIVE:
        load(put(path, value)).bind()
        return
    message = refusal(put(path, value))
    assert (
        message.startswith(f"{label(path)}: ") and f"must be >{'' if path in POSITIVE else '='} 0" in message
    )


@pytest.mark.few(9)
@pytest.mark.parametrize("path", [p for p, k, _ in PARTS if k == NUMBER], ids=label)
def test_expressions_that_are_not_finite(path: Path) -> None:
    assert refusal(put(path, "0/0")) == f"{label(path)}: must be a number, not nan"
    for value in ("1/0", "-1/0", "inf", "1e400", "10**400", "exp(9999)"):
        may_be = path[-1] in ("lower", "upper", "limit", "yield_speed") or (
            path[0] == "joints" and "stiffness" in str(path[-1])
        )
        if not may_be:
            assert refusal(put(path, value)).startswith(f"{label(path)}: must be finite, not "), value


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("contacts", 0, "restitution"), 1.5, "contacts.0.restitution: 1.5 must be >= 0 and <= 1"),
        ((*TIP, "motion", "axis"), [0, 0], "bodies.tip: the axis has no length"),
        (("bodies", "palm", "shape", "normal"), [0, 0], "bodies.palm.shape: the normal has no length"),
        (
            (*WEDGE, "shape", "vertices"),
            [[0, 0], [1, 0], [2, 0]],
            "bodies.wedge.shape: the outline is not a convex",
        ),
        (
            (*WEDGE, "shape", "vertices"),
            [[0, 0], [0, 0], [1, 1]],
            "bodies.wedge.shape: the outline is not a convex",
        ),
        (
            (*WEDGE, "shape", "vertices"),
            [[0, 0], [2, 0], [0.1, 0.1], [0, 2]],
            "bodies.wedge.shape: the outline is not",
        ),
        (
            (*WEDGE, "shape", "vertices"),
            [[0, 0], [1, 1], [1, 0], [0, 1]],
            "bodies.wedge.shape: the outline is not",
        ),
        (
            (*TIP, "coordinates", "s", "start"),
            2,
            "bodies.tip.coordinates.s: the start lies outside lower..upper",
        ),
        (
            (*TIP, "coordinates", "s", "lower"),
            2,
            "bodies.tip.coordinates.s: the start lies outside lower..upper",
        ),
        ((*PART, "mass"), 0, "bodies.part: a body that forces move needs a mass greater than 0"),
        ((*PART, "inertia"), 0, "bodies.part: a body that turns freely needs an inertia greater than 0"),
        ((*TIP, "coordinates", "zzz"), {}, "bodies.tip.coordinates: unknown coordinate 'zzz'; valid: s"),
        (
            (*WEDGE, "coordinates"),
            {"x": {}},
            "bodies.wedge.coordinates: unknown coordinate 'x'; valid: none (fixed)",
        ),
        (
            ("contacts", 0, "between"),
            ["zzz*", "part"],
            "contacts.0.between.0: 'zzz*' names no body; valid: tip, arm,",
        ),
        (("contacts", 0, "between"), ["part", "part"], "contacts.0.between: must name two bodies"),
        (("contacts", 0, "between"), ["part", ""], "contacts.0.between.1: must not be empty, not ''"),
        (
            ("potentials", 0, "terms"),
            {"zzz.s": 1},
            "potentials.0.terms: unknown coordinate 'zzz.s'; valid: tip.s, arm.turn",
        ),
        (
            ("potentials", 0, "on"),
            ["tip"],
            "potentials.0.on.0: unknown coordinate 'tip' (did you mean tip.s?); valid: tip.s",
        ),
        (
            ("parameters", "p", "range"),
            [1, 0],
            "parameters.p: range must be [low, high] with low <= default <= high",
        ),
        (
            ("parameters", "p", "default"),
            2,
            "parameters.p: range must be [low, high] with low <= default <= high",
        ),
        (("parameters", "t"), {"default": 1}, "parameters.t: the name is taken by the expression language"),
        (
            ("parameters", "sqrt"),
            {"default": 1},
            "parameters.sqrt: the name is taken by the expression language",
        ),
        (
            ("parameters", "lambda"),
            {"default": 1},
            "parameters.lambda: the name is taken by the expression language",
        ),
        ((*TIP, "mass"), "t", "bodies.tip.mass: unknown name t; valid: p"),
        (
            (*TIP, "support"),
            {"friction": 0.5, "load": 1},
            "bodies.tip.support: is for bodies whose motion is free, not slide; dry_friction is for single",
        ),
        (
            (*BALL, "gravity"),
            9.81,
            "bodies.ball.support: needs either load, a force, or gravity, an acceleration",
        ),
        (
            BALL,
            {"friction": 0.5},
            "bodies.ball.support: needs either load, a force, or gravity, an acceleration",
        ),
        (
            (*STOOL, "pressure", "points"),
            [],
            "bodies.stool.support.pressure.points: must have at least 1, not 0",
        ),
        (
            (*STOOL, "pressure", "weights"),
            [1],
            "bodies.stool.support.pressure: weights must be as many as points, 2, not 1",
        ),
        (
            (*STOOL, "pressure", "weights"),
            [0, "p - p"],
            "bodies.stool.support.pressure: one of the weights must be greater than 0",
        ),
        (
            ("bodies", "ball"),
            {
                "role": "object",
                "shape": {"kind": "point"},
                "motion": {"kind": "free"},
                "mass": 1,
                "inertia": 1,
                "support": {"friction": 0.5, "load": 1},
            },
            "bodies.ball.support.pressure: uniform pressure needs a shape with area; valid without: ring,",
        ),
        (
            ("bodies", "ball", "coordinates"),
            {"angle": {"dry_friction": 0.1}},
            "bodies.ball.coordinates.angle.dry_friction: the body has a support; give one of them",
        ),
        (
            (*SERVO[:-1], "drive"),
            {"kind": "servo", "stiffness": 1, "target_speed": "t"},
            "bodies.arm.coordinates.turn.drive.target_speed: unknown name t",
        ),
        ((*SERVO[:-1], "drive"), {"kind": "force"}, "bodies.arm.coordinates.turn.drive.force: is required"),
        (
            (*SERVO[:-1], "drive"),
            {"kind": "speed", "speed": None},
            "bodies.arm.coordinates.turn.drive.speed: must be a number",
        ),
        (
            (*SERVO[:-1], "drive"),
            {"kind": "speed", "speed": "zzz"},
            "bodies.arm.coordinates.turn.drive.speed: unknown name zzz; valid: p, u, t",
        ),
        (
            ("goal",),
            "gap(part, zzz) < 1",
            "goal: unknown name gap(part, zzz) (did you mean gap(part, rod)?); valid: p, u, t, tolerance",
        ),
        (("gravity",), ["zzz", 0], "gravity.0: unknown name zzz; valid: p, u"),
        (
            (*CROSS, "shape"),
            [{"kind": "disc", "radius": "zzz"}],
            "bodies.cross.shape.0.radius: unknown name zzz",
        ),
    ],
)
def test_what_the_message_says(path: Path, value: object, message: str) -> None:
    assert refusal(put(path, value)).startswith(message)


def test_expressions_of_contacts_that_hold_for_no_pair() -> None:
    for between in (["part", "*"], ["palm", "wedge"]):
        contacts = [*WHOLE["contacts"], {"between": between, "friction": "zzz"}]
        assert refusal(put(("contacts",), contacts)) == "contacts.1.friction: unknown name zzz; valid: p, u"


def test_impossible_values_are_told_from_wrong_ones() -> None:
    with pytest.raises(InvalidScene):
        load(put((*TIP, "mass"), "-p")).bind()
    with pytest.raises(InvalidScene):
        load(put((*TIP, "mass"), "p - 0.6")).bind()
    load(put((*TIP, "mass"), "p - 0.6")).bind({"p": 0.9})


def test_too_much() -> None:
    many = {f"b{i}": {"role": "obstacle", "shape": {"kind": "point"}} for i in range(2001)}
    assert refusal({"name": "many", "bodies": many}) == "bodies: must have at most 2000"
    body = {"role": "object", "shape": [{"kind": "point"}] * 32, "motion": {"kind": "free"}}
    crowd = {
        "name": "crowd",
        "bodies": {f"b{i}": body for i in range(50)},
        "contacts": [{"between": ["*", "*"]}],
    }
    assert refusal(crowd).startswith("contacts: more than 600000 pairs of shapes may touch")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"zzz": 1}, "parameters: unknown 'zzz'; valid: p"),
        ({1: 1}, "parameters: unknown 1; valid: p"),
        ({"a\nb": 1}, "parameters: unknown 'a\\nb'; valid: p"),
        ({"p": math.nan}, "parameters.p: must be finite, not nan"),
        ({"p": HUGE}, "parameters.p: must be finite"),
        ({"p": 2}, "parameters.p: 2 is outside 0 to 1"),
        ({"p": None}, "parameters.p: must be a number, not null"),
        ({"p": True}, "parameters.p: must be a number, not true"),
        ({"p": "0.5"}, "parameters.p: must be a number, not '0.5'"),
        ({"p": [0.5]}, "parameters.p: must be a number, not a list"),
        ({"p": np.array([0.5])}, "parameters.p: must be a number"),
        ({"p": np.complex128(0.5)}, "parameters.p: must be a number"),
        ({"p": np.bool_(True)}, "parameters.p: must be a number"),
        ([0.5], "parameters: must be a mapping of names"),
        ("p", "parameters: must be a mapping of names"),
    ],
)
def test_wrong_parameters(given: object, message: str) -> None:
    assert refusal(WHOLE, given).startswith(message)


@pytest.mark.parametrize("given", [{"p": 1}, {"p": np.float32(1)}, {"p": np.int64(1)}, {}, None])
def test_right_parameters(given: dict[str, float] | None) -> None:
    assert load(WHOLE).parameters(given)["p"] in (0.5, 1.0)


@pytest.mark.parametrize(
    "source",
    [None, 5, True, b"two_finger", ["two_finger"], object()],
    ids=lambda source: type(source).__name__,
)
def test_wrong_source(source: object) -> None:
    assert refusal(source).startswith("scene: must be a name, a path or a mapping, not ")


LAUGHS = "a: &a [x]\n" + "".join(
    f"b{i}: &b{i} [{', '.join(4 * [f'*b{i - 1}' if i else '*a'])}]\n" for i in range(50)
)
"""Each line repeats the one above it four times."""
FILES: dict[str | bytes, str] = {
    "": "scene: must be a mapping of fields, not null; valid: name",
    "text": "scene: must be a mapping of fields, not 'text'",
    "[a]": "scene: must be a mapping of fields, not a list",
    "3": "scene: must be a mapping of fields, not 3",
    "name: [": "line 1: expected the node content",
    "a: b: c": "line 1: mapping values are not allowed here",
    "name: x\n\tgoal: y": "line 2: ",
    "a: 1\n---\nb: 2": "line 2: but found another document",
    "name: a\nname: a": "line 2: 'name' is given twice",
    "x: {a: 1, b: 2, a: 1}": "line 1: 'a' is given twice",
    "? [a]\n: 1\n? [a]\n: 2": "line 1: found unhashable key",
    "{a: b}: c": "line 1: found unhashable key",
    "a: &x {<<: *x}": "line 1: aliases stand in what they repeat",
    "a: &x [1, *x]": "line 1: aliases stand in what they repeat",
    "a: *x": "line 1: found undefined alias",
    LAUGHS: "aliases make more than 100000 values; write out what they stand for",
    "!!python/object/apply:os.system [x]": "line 1: tags are not allowed",
    "!!binary aaa": "line 1: tags are not allowed",
    "!!bool x": "line 1: tags are not allowed",
    "!!set [a]": "line 1: tags are not allowed",
    "! x": "tags are not allowed",
    "name: 2001-13-45": "is not YAML of plain values",
    "name: 0b_": "is not YAML of plain values",
    "tolerance: " + "9" * 5000: "is not YAML of plain values",
    "[" * 50000: "is not YAML of plain values",
    "{a: " * 2000: "is not YAML of plain values",
    "- " * 2000: "is not YAML of plain values",
    "name: 2001-01-01": "name: must be a text, not an object of type date",
    "name: yes": "name: must be a text, not true",
    'name: "\\ud800"': "name: must be a text of valid characters",
    "name: \x07": "special characters are not allowed",
    b"\x89PNG\r\n\x1a\n\x00\xff": "cannot be read as a text file",
    b"\xff\xfea\x00": "cannot be read as a text file",
    b"\x00\x01\x02": "special characters are not allowed",
    b"a" * 2_000_001: "is larger than 2000000 bytes",
}


@pytest.mark.parametrize("content", FILES, ids=lambda x: ascii(x[:25]))
def test_wrong_file(content: str | bytes, tmp_path: Any) -> None:
    path = tmp_path / "scene.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert FILES[content] in refusal(path)


def test_no_file(tmp_path: Any) -> None:
    assert refusal("zzz") == "scene: 'zzz' is no file and no scene that ships; valid: " + ", ".join(shipped())
    assert "is no file and no scene that ships" in refusal(tmp_path / "none.yaml")
    assert "is no file and no scene that ships" in refusal("")
    assert "is no file and no scene that ships" in refusal("a\nb")
    assert "is no file and no scene that ships" in refusal("a\0b")
    assert "cannot be read as a text file" in refusal(LONG)
    assert "is a folder, not a YAML file" in refusal(tmp_path)
    assert "is no file" in refusal("/dev/zero")


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", [dict, OrderedDict, types.MappingProxyType], ids=lambda k: k.__name__)
def test_any_mapping_is_a_scene(kind: Any) -> None:
    load(kind(WHOLE)).bind()


def test_a_part_may_be_a_model() -> None:
    load(put((*TIP, "pose"), fields.Pose(x=1.0, y=9.0))).bind()
    load(put((*TIP, "shape"), shapes.Disc(kind="disc", radius=0.1))).bind()
