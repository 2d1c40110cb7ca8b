"""A parameter's unit is the scene's, or it is converted, or refused in a line: never ignored."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.scene.language.units import BASES, PREFIXES, SI, Measure, measured

SYMBOLS = [prefix + base for prefix, base in itertools.product(PREFIXES, BASES)]
KIND = {"m": "length", "g": "mass", "s": "time"}
OWN = {kind: [prefix + base for prefix in PREFIXES] for base, kind in KIND.items()}
UNITS = [*SYMBOLS, "N*s/m", "kg/m^3", "mN*mm/deg", "deg/s", "cm/s^2", "g*mm^2", "kN/mm", "1", "rad/ms"]


def scene(unit: str, *, units: dict[str, str] | None = None, read: str = "a", value: float = 30.0) -> Any:
    """A body whose angle, place and mass read a parameter of a unit."""
    body = {
        "role": "object", "mass": 1.0, "shape": {"kind": "disc", "radius": 1.0},
        "pose": {"angle": read}, "motion": {"kind": "free"},
    }  # fmt: skip
    data = {"name": "any", "parameters": {"a": {"default": value, "unit": unit}}, "bodies": {"b": body}}
    return data if units is None else data | {"units": units}


def angle(data: Any) -> float:
    return float(rw.load(data).start()[0][2])


def worth(unit: str, units: dict[str, str]) -> float:
    """One of a unit in a scene's, by the definition of units."""
    scale, powers, degrees = measured(unit)
    own = math.prod(
        measured((SI | units)[kind]).scale ** power for kind, power in zip(SI, powers, strict=True)
    )
    return float(scale / own * math.radians(1.0) ** degrees)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "units", [None, {"length": "mm", "mass": "g", "time": "ms"}, {"length": "cm"}, {"time": "us"}]
)
def test_every_unit_is_the_scenes_or_converted_or_refused(units: dict[str, str] | None) -> None:
    for unit in UNITS:
        factor = worth(unit, units or {})
        is_si = measured(unit).scale == pytest.approx(1.0, rel=1e-9)
        if units is None and not is_si:
            with pytest.raises(rw.SceneError, match=r"^parameters\.a\.unit: .*units: \{length: mm\}"):
                rw.load(scene(unit, read="a * 3 / 3"))
            continue
        assert angle(scene(unit, units=units, read="a * 3 / 3")) == pytest.approx(30.0 * factor, rel=1e-12), (
            unit
        )


def test_units_taken_apart() -> None:
    assert measured("kN*mm/deg") == Measure(pytest.approx(1.0), (2, 1, -2), -1)
    assert measured("g*mm/ms^2") == Measure(pytest.approx(1.0), (1, 1, -2), 0)
    assert measured("1") == Measure(1.0, (0, 0, 0), 0)
    assert worth("deg/s", {}) == pytest.approx(math.pi / 180)


@pytest.mark.parametrize(
    ("read", "value"),
    [
        ("a", math.radians(30)),
        ("-a", -math.radians(30)),
        ("a * deg", math.radians(30)),
        ("deg * a", math.radians(30)),
        ("2 * (a + 5) * deg", 2 * math.radians(35)),
        ("2 * (a + 5 * deg)", 2 * math.radians(35)),
        ("sin(a)", 0.5),
        ("sin(a * deg)", 0.5),
        ("a / deg", 30.0),
        ("atan(tan(a)) / deg * a * deg", 30.0 * math.radians(30) * math.radians(1)),
        ("max(a, -a) if a > 0.1 else 0", math.radians(30)),
        ("a * a", math.radians(30) ** 2),
        ("1 / a", 1 / math.radians(30)),
        ("cos(pi / 3) * a", math.radians(15)),
        ("a * pi / 180", math.radians(30)),
        ("pi * a / 180", math.radians(30)),
        ("(a + 5) * (pi / 180)", math.radians(35)),
        ("-2 * pi * a / 360", -math.radians(30)),
        ("a * -(pi / 180)", -math.radians(30)),
        ("a * -deg", -math.radians(30)),
        ("sin(a * pi / 180)", 0.5),
        ("a * 180 / pi", 30.0),
        ("a + 5 * pi / 180", math.radians(35)),
        ("pi / (180 / a)", math.radians(30)),
    ],
)  # fmt: skip
def test_degrees_are_converted_once(read: str, value: float) -> None:
    assert angle(scene("deg", read=read)) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "read", ["a * pi / 200", "pi * a", "(a + 5) * (pi / 90)", "a * pi * pi / 180", "a * 180 * pi"]
)
def test_products_of_degrees_and_pi_that_are_no_conversion_are_refused(read: str) -> None:
    with pytest.raises(
        rw.SceneError, match=r"^bodies\.b\.pose\.angle: a is in deg .* write a, a \* deg or a \* pi / 180"
    ):
        rw.load(scene("deg", read=read))


def test_degrees_in_conditions_inputs_sets_and_questions() -> None:
    """A parameter keeps its own unit outside expressions: given values, ranges, boxes, inputs, answers."""
    data = scene("deg", value=20.0) | {"goal": "(b.angle >= a + 10 * deg for 0) or b.angle >= a"}
    given = rw.load(data)
    assert given.parameters({"a": 40.0}) == {"a": 40.0}
    assert given.start({"a": 45.0})[0][2] == pytest.approx(math.pi / 4)
    states = rw.State.of(given, {"b.angle": math.radians(21.0)})
    answer = rw.ask(given, "goal", states)
    assert answer.holds[0] and answer.margin[0] == pytest.approx(math.radians(1.0))
    assert not rw.ask(given, "goal", states, {"a": 22.0}).holds[0]
    run = rw.simulate(given, "kinematic", parameters={"a": 10.0})
    assert run.parameters == {"a": 10.0} and run.final["b"]["angle"] == pytest.approx(math.radians(10.0))


def test_inputs_over_time_are_in_the_parameters_unit() -> None:
    data = scene("deg", value=0.0, read="0") | {"inputs": ["a"], "duration": 1.0}
    data["bodies"]["b"]["motion"] = {"kind": "hinge", "pivot": [0.0, 0.0]}
    data["bodies"]["b"]["coordinates"] = {"angle": {"drive": {"kind": "speed", "speed": "a / 1"}}}
    data["bodies"]["b"]["role"] = "robot"
    run = rw.simulate(data, "kinematic", inputs=[{"inputs": {"a": 90.0}, "duration": 1.0}])
    assert run.final["b"]["angle"] == pytest.approx(math.pi / 2, rel=1e-6)
    rolled = rw.rollout(data, "kinematic", inputs=np.array([[[90.0]], [[45.0]]]), durations=1.0)
    assert rolled.final[:, 0] == pytest.approx([math.pi / 2, math.pi / 4], rel=1e-6)


def test_the_same_task_in_two_units() -> None:
    """A box is pushed; lengths of parameters in mm, in a scene that counts in m but for them, or in mm."""
    run = rw.simulate("push", "dynamic-rigid", duration=0.5)
    file = rw.load("push").file.model_dump(mode="json", exclude_unset=True)
    for name, each in file["parameters"].items():
        if each.get("unit") == "m":
            for key in ("default", "range"):
                each[key] = (np.array(each[key]) * 1e3).tolist()
            file["parameters"][name] = each | {"unit": "mm"}
    with pytest.raises(rw.SceneError, match="parameters"):
        rw.load(file)
    again = rw.simulate(file | {"units": {}}, "dynamic-rigid", duration=0.5)
    assert again.outcome == run.outcome
    for body, places in run.final.items():
        assert again.final[body] == pytest.approx(places, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"length": "s"}, "units.length: must be a unit of length, not 's'"),
        ({"mass": "mm"}, "units.mass: must be a unit of mass, not 'mm'"),
        ({"time": "m/s"}, "units.time: must be a unit of time, not 'm/s'"),
        ({"length": "inch"}, "units.length: unknown unit 'inch'"),
        ({"lenght": "mm"}, "units: unknown field 'lenght' (did you mean length?)"),
    ],
)
def test_wrong_units(units: dict[str, str], message: str) -> None:
    with pytest.raises(rw.SceneError) as error:
        rw.load(scene("1", units=units))
    assert message in str(error.value)


def test_worlds_of_ones_own_and_space_convert_too() -> None:
    data = {
        "name": "turned", "model": {"file": "slope.xml"},
        "parameters": {"angle": {"default": 20.0, "unit": "deg"}},
    }  # fmt: skip
    for read in ("9.81 * sin(angle * deg)", "9.81 * sin(angle)"):
        model = data["model"] | {"set": {"option": {"gravity": [read, 0, 0]}}}
        bound = rw.load(data | {"model": model}).bind()
        assert bound.model.opt.gravity[0] == pytest.approx(9.81 * math.sin(math.radians(20)))
