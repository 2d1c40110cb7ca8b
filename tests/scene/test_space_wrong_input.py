"""Wrong scenes in space: one line that names the field, and exit code 2 without a traceback."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

import rungwise as rw
from rungwise import cli
from rungwise.errors import InputError
from rungwise.scene import SceneError
from rungwise.scene.fields.fields import Parameter
from rungwise.scene.space import SpaceScene
from rungwise.simulation.options import ModelError

MODEL = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
<body name="b" pos="0 0 .1"><freejoint/><geom name="g" size=".1" mass="1"/></body>
<body name="p" pos="1 0 1"><joint name="j" type="slide"/><geom name="h" size=".1"/></body></worldbody>
<actuator>{}<position name="a" joint="j" kp="5"/></actuator>{}
<keyframe><key name="k" qpos="0 0 1 1 0 0 0 0"/><key qpos="0 0 2 1 0 0 0 0"/></keyframe></mujoco>"""
WHOLE: dict[str, Any] = {
    "name": "whole",
    "parameters": {"mu": {"default": 0.5, "range": [0.0, 1.0]}},
    "inputs": ["mu"],
    "model": {
        "file": "m.xml",
        "set": {"geoms": {"g": {"density": 100.0}}, "option": {"gravity": [0, 0, -9]}},
    },
    "contacts": [{"between": ["b", "*"], "friction": "mu", "stiffness": 1e5}],
    "controls": {"a": "0.1 * t"},
    "speeds": {"p.j": 0.0},
    "start": {"keyframe": "k", "places": {"b.z": 0.1}, "velocities": {"b.x": 1.0}},
    "goal": "b.x > 1",
    "duration": 0.02,
    "step": 1e-2,
}
NAN, INF = math.nan, math.inf
LAW, HELD = {"adhesion": 1.0}, {"static_friction": 0.5}
CASES: list[tuple[str, Any, str]] = [
    ("nme", 1, "scene: unknown field 'nme' (did you mean name?)"),
    ("model.fil", "x", "model: unknown field 'fil' (did you mean file?)"),
    ("model.file", "nope.xml", "model.file: 'nope.xml' is no file"),
    ("model.file", "nopackage:x.xml", "model.file: 'nopackage:x.xml' lies in the package nopackage"),
    ("model.file", 3, "model.file: must be a text, not 3"),
    ("model.set.geoms", {"gg": {"density": 1}}, "model.set.geoms.gg: unknown geom (did you mean g?)"),
    ("model.set.geoms", {"g": {"dens": 1}}, "model.set.geoms.g.dens: unknown field 'dens' (did you mean"),
    ("model.set.geoms.g.density", NAN, "model.set.geoms.g.density: must be finite, not nan"),
    ("model.set.geoms.g.density", "x", "model.set.geoms.g.density: unknown name x"),
    ("model.set.geoms.g.density", [1, 2], "model.set.geoms.g.density: must be a number, not a list"),
    ("model.set.geoms.g", {"size": [1, 2, 3, 4]}, "model.set.geoms.g.size: must have at most 3 numbers"),
    ("model.set.geoms.g", {"size": [-1]}, "model: 'm.xml': "),
    ("model.set.option.gravity", [0, 0, "1 / 0"], "model.set.option.gravity.2: must be finite, not inf"),
    ("model.set.option", {"gravty": 1}, "model.set.option.gravty: unknown field 'gravty' (did you mean"),
    ("contacts", 3, "contacts: must be a list, not 3"),
    ("contacts.0.adhesion", -1.0, "contacts.0.adhesion: -1 must be >= 0"),
    ("contacts.0.adhesion", "inf", "contacts.0.adhesion: must be finite, not inf"),
    ("contacts.0.adhesion_range", 1e-3, "contacts.0: adhesion_range needs adhesion, a force"),
    ("contacts", [LAW | {"adhesion_range": 0.0}], "contacts.0.adhesion_range: 0 must be > 0"),
    ("contacts.0.yield_speed", 0.0, "contacts.0.yield_speed: 0 must be > 0"),
    ("contacts.0.yield_speed", "tt", "contacts.0.yield_speed: unknown name tt; valid: mu"),
    ("contacts.0.impact", "hertz", "contacts.0.impact: must be 'newton' or 'poisson', not 'hertz'"),
    ("contacts.0.static_friction", -1, "contacts.0.static_friction: -1 must be >= 0"),
    ("contacts", [HELD | {"friction": 0.6}], "contacts.0: static_friction must be at least friction"),
    ("contacts", [HELD], "contacts.0.static_friction: 0.5 is below the model's friction of floor and g, 1"),
    ("contacts.0.between", ["zz", "b"], "contacts.0.between.0: 'zz' matches no geom and no body"),
    ("contacts.0.between", ["b"], "contacts.0.between.1: is required"),
    ("contacts.0.sliding", 1, "contacts.0: unknown field 'sliding'"),
    ("contacts.0.friction", -1, "contacts.0.friction: -1 must be >= 0"),
    ("contacts.0.friction", "muu", "contacts.0.friction: unknown name muu (did you mean mu?)"),
    ("contacts.0.friction", True, "contacts.0.friction: must be a number or an expression"),
    ("contacts.0.friction", "inf", "contacts.0.friction: must be finite, not inf"),
    ("contacts.0.stiffness", 0, "contacts.0.stiffness: 0 is outside its range"),
    ("contacts.0.damping", -1, "contacts.0.damping: -1 is outside its range"),
    ("contacts.0.tangential_stiffness", -1, "contacts.0.tangential_stiffness: -1 is outside its range"),
    ("contacts.0.tangential_damping", -1, "contacts.0.tangential_damping: -1 is outside its range"),
    ("contacts.0.restitution", 2, "contacts.0.restitution: 2 is outside its range"),
    ("controls", {"b": 1}, "controls.b: unknown name; valid: a"),
    ("controls.a", "b.x", "controls.a: unknown name b.x; valid: mu, t"),
    ("controls.a", NAN, "controls.a: must be finite, not nan"),
    ("controls.a", "1 / (t - 0.01)", "controls.a: must be finite, not inf at t = 0.01"),
    ("speeds", {"b.qw": 1}, "speeds.b.qw: unknown name"),
    ("speeds", {"p.j": None}, "speeds.p.j: must be a number or an expression"),
    ("speeds.p.j", "inf", "speeds.p.j: must be finite, not inf at t = 0"),
    ("start.keyframe", "kk", "start.keyframe: unknown 'kk' (did you mean k?)"),
    ("start.keyframe", "", "start.keyframe: "),
    ("start.places", {"b.zz": 1}, "start.places.b.zz: unknown name (did you mean b.z?)"),
    ("start.places", {"b.z": "t"}, "start.places.b.z: unknown name t"),
    ("start.places", {"b.z": "inf"}, "start.places.b.z: must be finite, not inf"),
    ("start.velocities", {"b.qw": 1}, "start.velocities.b.qw: unknown name"),
    ("start.velocities", {"b.x": "inf"}, "start.velocities.b.x: must be finite, not inf"),
    ("goal", 3, "goal: must be a text, not 3"),
    ("goal", "c.x > 1", "goal: unknown name c.x (did you mean b.x?)"),
    ("goal", "gap(b, c) > 1", "goal: unknown name gap(b, c) (did you mean gap(b, p)?)"),
    ("goal", "speed(b.qw) > 1", "goal: unknown name speed(b.qw)"),
    ("unsafe", "b.x + 1", "unsafe: 'b.x + 1' is not a condition"),
    ("duration", 0, "duration: 0 must be > 0"),
    ("duration", "inf", "duration: must be finite, not inf"),
    ("step", -1, "step: -1 must be > 0"),
    ("tolerance", 0, "tolerance: 0 must be > 0"),
    ("inputs", ["v"], "scene: inputs: v is not a parameter"),
    ("parameters.mu.default", 2.0, "parameters.mu: range must be [low, high] with low <= default <= high"),
]
REFUSED = {
    "an actuator with a state of another kind": (
        '<general name="m" joint="j" dyntype="muscle" actlimited="true" actrange="0 1"/>', ""
    ),
    "an actuator whose gain changes": ('<general name="m" joint="j" gaintype="affine" gainprm="1 1"/>', ""),
    "an actuator that adheres": ('<adhesion name="m" body="b" ctrlrange="0 1"/>', ""),
    "an actuator that pushes away from its target": (
        '<general name="m" joint="j" biastype="affine" biasprm="0 5 0"/>', ""
    ),
    "an actuator with a delay": ('<motor name="m" joint="j" delay="0.1" nsample="100"/>', ""),
    "an actuator's damping that changes": ('<motor name="m" joint="j" damping="1 1"/>', ""),
    "a flag": ("", '<option><flag spring="disable"/></option>'),
    "a fluid": ("", '<option density="1.2" viscosity="0.1"/>'),
}  # fmt: skip


def written(folder: Path, name: str = "m.xml", text: str = MODEL.format("", "")) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def changed(folder: Path, field: str, value: Any) -> dict[str, Any]:
    """The whole scene with another value in one field."""
    scene: Any = copy.deepcopy(WHOLE)
    scene["model"]["file"] = str(written(folder))
    *way, last = field.split(".") if not field.startswith(("speeds.p", "x")) else ["speeds", "p.j"]
    inside = scene
    for part in way:
        inside = inside[int(part) if isinstance(inside, list) else part]
    inside[last] = value
    return scene  # type: ignore[no-any-return]


Command = Callable[..., tuple[int, str]]


@pytest.fixture
def rungwise(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """A function of the command line's words: the exit code, and what it writes as an error."""

    def run(*arguments: str) -> tuple[int, str]:
        monkeypatch.setattr("sys.argv", ["rungwise", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.main()
        code = end.value.code
        assert isinstance(code, int)
        return code, capsys.readouterr().err.strip()

    return run


def told(work: Callable[[], Any]) -> str:
    """What is said about wrong input, by an error of the scene or by a run that is invalid."""
    try:
        run = work()
    except SceneError as error:
        return str(error)
    assert run.outcome.name == "invalid"
    return str(run.reason)


def test_the_whole_scene_runs(tmp_path: Path) -> None:
    run = rw.simulate(rw.load(changed(tmp_path, "name", "other")), rw.DYNAMIC_RIGID)
    assert run.outcome.name == "timeout"


@pytest.mark.parametrize(("field", "value", "line"), CASES, ids=[f"{f}={v}"[:40] for f, v, _ in CASES])
def test_wrong_values_are_one_line_that_names_the_field(
    tmp_path: Path, field: str, value: Any, line: str
) -> None:
    scene = changed(tmp_path, field, value)
    said = told(lambda: rw.simulate(rw.load(scene), rw.DYNAMIC_RIGID))
    assert said.startswith(line)
    assert "\n" not in said


@pytest.mark.parametrize("feature", REFUSED)
def test_features_without_counterpart_are_refused_and_named(tmp_path: Path, feature: str) -> None:
    actuator, more = REFUSED[feature]
    path = written(tmp_path, text=MODEL.format(actuator, more))
    with pytest.raises(SceneError, match=f"model: {feature} has no counterpart in these models"):
        rw.load(path)


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("broken.xml", "<mujoco><worldbody>"),
        ("empty.xml", ""),
        ("other.xml", "<html/>"),
        ("unknown.xml", "<mujoco><worldbody><geom typ='box'/></worldbody></mujoco>"),
        ("heavy.xml", "<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>"),
        ("broken.urdf", "<robot name='r'><link name='a'>"),
        ("lost.urdf", "<robot name='r'><joint name='j' type='revolute'><parent link='a'/></joint></robot>"),
        ("binary.xml", "\x00\x01"),
    ],
)
def test_model_files_that_cannot_be_read_are_refused_in_one_line(
    tmp_path: Path, name: str, text: str, rungwise: Command
) -> None:
    path = written(tmp_path, name, text)
    with pytest.raises(SceneError) as error:
        rw.load(path)
    assert str(error.value).startswith(f"model: {name!r}") and "\n" not in str(error.value)
    code, said = rungwise("sim", str(path), "--model", "dynamic-rigid")
    assert code == 2 and name in said and "Traceback" not in said and "\n" not in said


def test_the_command_line_ends_with_2_and_one_line(tmp_path: Path, rungwise: Command) -> None:
    for arguments, word in (
        (["sim", "ball", "--model", "dynamic-rigid", "--set", "muu=1"], "muu"),
        (["sim", "ball", "--model", "dynamic-rigid", "--set", "mu=-1"], "mu"),
        (["sim", "ball", "--model", "dynamic-rigid", "--set", "mu=nan"], "mu"),
        (["sim", "ball", "--model", "dynamic-rigid", "--step", "0"], "step"),
        (["sim", "ball", "--model", "geometric"], "geometric"),
        (["sim", str(tmp_path / "none.xml"), "--model", "dynamic-rigid"], "none.xml"),
    ):
        code, said = rungwise(*arguments)
        assert code == 2 and word in said and "Traceback" not in said and "\n" not in said


# What is wrong whatever the parameters' values is told when the scene is read.
UNKNOWN: list[tuple[str, Any, str]] = [
    ("model.set.geoms", {"gg": {"density": 1}}, "model.set.geoms.gg: unknown geom"),
    ("model.set.joints", {"jj": {"damping": 1}}, "model.set.joints.jj: unknown joint"),
    ("model.set.geoms", {"g": {"dens": 1}}, "model.set.geoms.g.dens: unknown field"),
    ("model.set.geoms.g.density", "2 * muu", "model.set.geoms.g.density: unknown name muu"),
    ("model.set.option.gravity", [0, 0, "gg"], "model.set.option.gravity.2: unknown name gg"),
    ("contacts.0.between", ["zz", "b"], "contacts.0.between.0: 'zz' matches no geom and no body"),
    ("contacts.0.friction", "muu", "contacts.0.friction: unknown name muu"),
    (
        "contacts.0.torsional_friction",
        0.1,
        "contacts.0.torsional_friction: these contacts have condim 3, not 4",
    ),
    ("contacts.0.rolling_friction", 0.1, "contacts.0.rolling_friction: these contacts have condim 3, not 6"),
    ("controls", {"b": 1}, "controls.b: unknown name; valid: a"),
    ("controls.a", "b.x", "controls.a: unknown name b.x"),
    ("speeds", {"b.qw": 1}, "speeds.b.qw: unknown name"),
    ("speeds", {"p.j": "2 *"}, "speeds.p.j: "),
    ("start.keyframe", "kk", "start.keyframe: unknown 'kk' (did you mean k?)"),
    ("start.places", {"b.zz": 1}, "start.places.b.zz: unknown name (did you mean b.z?)"),
    ("start.places", {"b.z": "t"}, "start.places.b.z: unknown name t"),
    ("start.velocities", {"b.qw": 1}, "start.velocities.b.qw: unknown name"),
    ("duration", "muu", "duration: unknown name muu"),
]


@pytest.mark.parametrize(("field", "value", "line"), UNKNOWN, ids=[f"{f}={v}"[:40] for f, v, _ in UNKNOWN])
def test_unknown_names_are_told_when_the_scene_is_read(
    tmp_path: Path, field: str, value: Any, line: str
) -> None:
    with pytest.raises(SceneError) as error:
        rw.load(changed(tmp_path, field, value))
    assert str(error.value).startswith(line) and "\n" not in str(error.value)


IMPOSSIBLE = [1e300, 1e76, -1e300]
SETTABLE = [
    ("geoms", "g", "density", [-1.0, 0.0, 1e300]),
    ("geoms", "g", "mass", [-1.0, 0.0, 1e300]),
    ("geoms", "g", "size", [-1.0, 0.0, 1e300]),
    ("geoms", "g", "pos", IMPOSSIBLE),
    ("geoms", "g", "friction", [-1.0, 1e300]),
    ("bodies", "b", "pos", IMPOSSIBLE),
    ("joints", "j", "damping", [-1.0, 1e300]),
    ("joints", "j", "frictionloss", [-1.0, 1e300]),
    ("joints", "j", "armature", [-1.0, 1e300]),
    ("joints", "j", "stiffness", [-1.0, 1e300]),
    ("actuators", "a", "gainprm", IMPOSSIBLE),
]
NUMBERS = [(*way, value) for *way, values in SETTABLE for value in values]


@pytest.mark.parametrize(("group", "name", "field", "value"), NUMBERS, ids=str)
def test_impossible_numbers_of_the_model_are_one_line(
    tmp_path: Path, group: str, name: str, field: str, value: float
) -> None:
    scene = changed(tmp_path, "model.set", {group: {name: {field: "mu * value"}}})
    scene["parameters"] |= {"value": {"default": 2.0 * value}}
    if field == "density":  # which the geom's own mass would stand for
        bare = MODEL.format("", "").replace(' mass="1"', "")
        scene["model"]["file"] = str(written(tmp_path, "bare.xml", bare))
    loaded = rw.load(scene)  # well written, and impossible at these parameters
    run = rw.simulate(loaded, rw.DYNAMIC_RIGID)
    assert run.outcome.name == "invalid", "other parameters are possible"
    assert run.reason.startswith("model: ") and "\n" not in run.reason
    rolled = rw.rollout(loaded, rw.DYNAMIC_RIGID, parameters={"value": [2.0 * value]}, durations=0.01)
    assert rolled.faults[0] == f"sample 0: {run.reason}"


@pytest.mark.parametrize("where", ["places", "velocities"])
@pytest.mark.parametrize("value", [1e300, -1e11, 1e76])
def test_a_start_too_far_or_too_fast_is_refused_by_name(tmp_path: Path, where: str, value: float) -> None:
    said = told(
        lambda: rw.simulate(rw.load(changed(tmp_path, f"start.{where}", {"b.z": value})), "kinematic")
    )
    assert said.startswith(f"start.{where}.b.z: ") and "must be within" in said


WRONG: dict[str, Sequence[Any]] = {
    "step": (0, -1.0, NAN, INF, "x", True),
    "tol": (0, -1.0, NAN, INF, "x", True),
    "duration": (0, -1.0, NAN, INF, "x", True),
    "span": (0, -1.0, NAN, INF, "x", True),
    "theta": (0, 2, NAN, INF, "x", True),
    "frames": (0, 2, -1, 3.5, NAN, INF, "x", True, None),
    "stride": (0, -1, 1.5, NAN, INF, "x", True),
}
OPTIONS = [(name, value) for name, values in WRONG.items() for value in values]


@pytest.mark.parametrize(("name", "value"), OPTIONS, ids=str)
@pytest.mark.parametrize("scene", ["ball", "two_finger"])
def test_options_out_of_range_are_refused_by_name_in_space_as_in_the_plane(
    scene: str, name: str, value: Any
) -> None:
    with pytest.raises(ModelError, match=f"^{'time' if name == 'duration' else name}: must be"):
        rw.simulate(scene, rw.DYNAMIC_RIGID, **{name: value})


@pytest.mark.parametrize("name", ["budget", "threads", "chunk"])
@pytest.mark.parametrize("value", [0, -1, 1.5, NAN, INF, "x", True])
@pytest.mark.parametrize("scene", ["ball", "two_finger"])
def test_counts_of_rollouts_are_refused_by_name(scene: str, name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name}: .*must be"):
        rw.rollout(scene, rw.DYNAMIC_RIGID, durations=0.01, **{name: value})


@pytest.mark.parametrize("step", [0, -1.0, NAN, INF, "x", True])
def test_the_step_of_a_replay_is_refused_by_name(step: Any) -> None:
    run = rw.simulate("ball", rw.DYNAMIC_RIGID, duration=0.01)
    with pytest.raises(ModelError, match=r"^step: must be"):
        rw.replay(run, step=step)


def test_states_and_schedules_of_another_scene_are_refused() -> None:
    ball, slope = rw.load("ball"), rw.load("slope")
    assert isinstance(ball, SpaceScene)
    state = rw.simulate(ball, rw.DYNAMIC_RIGID, duration=0.01).state
    with pytest.raises(rw.StateError, match="state: has the coordinates"):
        rw.simulate(slope, rw.DYNAMIC_RIGID, state=state)
    with pytest.raises(rw.ScheduleError, match=r"inputs\.0\.inputs: unknown input 'mu'"):
        rw.simulate(ball, rw.DYNAMIC_RIGID, inputs=[{"inputs": {"mu": 1.0}, "duration": 1.0}])


ODD = """<mujoco><worldbody><body name="l{0}1"><joint name="j{0}1"/><geom name="g{0}1" size=".1"/>
<body name="l{0}2" pos="1 0 0"><joint name="k" type="slide"/><geom size=".1"/></body></body></worldbody>
<actuator><position name="a{0}1" joint="j{0}1" kp="10"/></actuator></mujoco>"""
"""A model whose names have another character than letters, digits and _."""


@pytest.mark.parametrize("mark", [".", "/", "-", ":", " ", "é"])
def test_names_of_the_model_are_told_as_labels(mark: str, tmp_path: Path) -> None:
    """Wherever a scene writes the model's own name, the error gives the text to write, and it is taken."""
    written(tmp_path, text=ODD.format(mark))
    whole = {"name": "odd", "model": {"file": str(tmp_path / "m.xml")}}
    assert rw.load(whole).template.coordinates == ("l_1.j_1", "l_2.k")
    for given, right in (
        ({"goal": "l{0}1.j{0}1 >= 1"}, {"goal": "l_1.j_1 >= 1"}),
        ({"goal": "j{0}1 >= 1 and t > 0"}, {"goal": "l_1.j_1 >= 1 and t > 0"}),
        ({"goal": "k >= 1"}, {"goal": "l_2.k >= 1"}),
        ({"unsafe": "gap(l{0}1, l{0}2) < 1"}, {"unsafe": "gap(l_1, l_2) < 1"}),
        ({"start": {"places": {"l{0}1.j{0}1": 1}}}, {"start": {"places": {"l_1.j_1": 1}}}),
        ({"speeds": {"l{0}2.k": "1"}}, {"speeds": {"l_2.k": "1"}}),
        ({"controls": {"a{0}1": 1}}, {"controls": {"a_1": 1}}),
    ):
        wrong = eval(repr(given).replace("{0}", mark))
        with pytest.raises(SceneError) as caught:
            rw.load(whole | wrong)
        ((_, value),) = right.items()
        while isinstance(value, dict):
            ((name, value),) = value.items()
            value = value if isinstance(value, dict) else name
        assert f"; write {value!r}: names keep letters, digits and _" in str(caught.value)
        rw.load(whole | right)
    with pytest.raises(SceneError, match=r"must be a name .*; u_1 would be one"):
        rw.load(whole | {"parameters": {f"u{mark}1": {"default": 0}}})


def test_programs_may_write_aliases(tmp_path: Path) -> None:
    """A scene dumped with values that it shares is the scene written out."""
    written(tmp_path)
    pair = ["b", "*"]
    shared = WHOLE | {"contacts": [{"between": pair, "friction": 0.5}, {"between": pair, "friction": 0.4}]}
    (tmp_path / "shared.yaml").write_text(yaml.safe_dump(shared))
    assert "*id001" in (tmp_path / "shared.yaml").read_text()
    plain = copy.deepcopy(shared)
    plain["contacts"][1]["between"] = ["b", "*"]
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(plain))
    one, other = (rw.load(tmp_path / f"{name}.yaml") for name in ("shared", "plain"))
    assert one == other


def test_other_parameters_are_other_names(tmp_path: Path) -> None:
    """A scene that is given other parameters knows those, in its conditions and schedules."""
    scene = rw.load(written(tmp_path))
    more = scene.changed(
        parameters=dict(scene.file.parameters) | {"far": Parameter(default=2.0)}, inputs=("a", "far")
    )
    assert more.template.parameters == (*scene.template.parameters, "far")
    assert more.template.inputs == ("a", "far")
    told = more.changed(goal="p.j > far")
    assert told.parameters({"far": 3.0})["far"] == 3.0
    assert not told.goal(rw.State.of(told, {"p.j": 2.5}), {"far": 3.0}).holds[0]
    assert told.goal(rw.State.of(told, {"p.j": 2.5})).holds[0]
    run = rw.simulate(told, "kinematic", inputs=[{"inputs": {"far": 1.0}, "duration": 0.01}])
    assert run.inputs[0].inputs == {"far": 1.0}
