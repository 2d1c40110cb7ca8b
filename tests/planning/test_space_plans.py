"""Plans of scenes in space: a pusher on a slide pushes a box over a table to where it is told."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise import cli
from rungwise.outcome import Code
from rungwise.planning.execution.feedback import Replanner
from rungwise.planning.motion.budget import Budget
from rungwise.planning.motion.propagate import Places, Predictor
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of
from rungwise.scene.space import SpaceScene
from rungwise.world.find import world_of
from rungwise.world.spatial.variant import SpatialVariant as SpaceWorld

MODEL = """<mujoco><worldbody><geom name="table" type="plane" size="2 2 .1"/>
<body name="pusher" pos="-.1 0 .05"><joint name="along" type="slide" axis="1 0 0"/>
<geom name="pusher" type="sphere" size=".02" mass=".2"/></body>
<body name="box" pos="0 0 .05"><freejoint/><geom name="box" type="box" size=".05 .05 .05" mass=".5"/></body>
</worldbody>
<actuator><position name="servo" joint="along" kp="400" kv="20"/></actuator></mujoco>"""
GAP = 0.03
"""What is between pusher and box at the start."""
TARGET = 0.2
STAGES = [("kinematic", 1e-2), ("dynamic-compliant", 1e-2), ("dynamic-compliant", 1e-3)]
COARSE = [("dynamic-compliant", 1e-2)]
Make = Callable[..., SpaceScene]


@pytest.fixture(scope="module")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """A function of fields of the scene, and of its task."""
    path = tmp_path_factory.mktemp("model") / "pusher.xml"
    path.write_text(MODEL)

    def made(task: dict[str, Any] | None = None, **fields: Any) -> SpaceScene:
        given: dict[str, Any] = {
            "name": "pusher",
            "model": {"file": str(path)},
            "parameters": {
                "aim": {"default": 0.0, "range": [-0.1, 0.5]},
                "mu": {"default": 0.5, "range": [0.0, 2.0]},
                "target": {"default": TARGET, "range": [0.0, 0.4]},
                "begins": {"default": 0.0, "range": [-0.2, 0.2]},
            },
            "inputs": ["aim"],
            "controls": {"servo": "aim"},
            "start": {"places": {"box.x": "begins"}},
            "contacts": [{"friction": "mu", "stiffness": 1e5, "damping": 1e2}],
            "goal": "abs(box.x - target) <= 0.01 and abs(speed(box.x)) <= 0.02",
            "tolerance": 1e-3,
            "step": 2e-3,
            "task": {
                "instances": {"target": {"uniform": [0.1, 0.3]}},
                "uncertain": {"mu": {"uniform": [0.3, 0.7]}, "aim": {"normal": [0.0, 0.004]}},
                "inputs": {"aim": {"range": [0.0, 0.45], "rate": 0.5}},
                "moves": [1, 2],
                "duration": [0.2, 0.6],
            }
            | (task or {}),
        }
        scene = rw.load(given | fields)
        assert isinstance(scene, SpaceScene)
        return scene

    return made


@pytest.fixture(scope="module")
def scene(make: Make) -> SpaceScene:
    return make()


@pytest.fixture(scope="module")
def plan(scene: SpaceScene) -> rw.Plan:
    return rw.plan(scene, schedule=STAGES, threads=1, budget=60_000)


@pytest.fixture(scope="module")
def drawn(scene: SpaceScene) -> rw.Plan:
    """Of an instance that the task draws."""
    return rw.plan(scene, schedule=COARSE, task_seed=5, seed=3, threads=1)


@pytest.mark.long
def test_a_plan_pushes_the_box_to_its_target(plan: rw.Plan) -> None:
    assert plan.found
    run = plan.replay()
    assert str(run.outcome) == "goal"
    assert run.final["box"]["x"] == pytest.approx(TARGET, abs=0.01)
    # The box ends where the pusher's way does, unless it coasts.
    assert plan.segments[-1].inputs["aim"] == pytest.approx(TARGET + GAP, abs=0.02)


@pytest.mark.long
def test_records_say_what_each_stage_took(plan: rw.Plan) -> None:
    assert [each.stage for each in plan.records] == [f"{model} @ {accuracy:g}" for model, accuracy in STAGES]
    assert plan.records[0].how == "planned"
    assert 0 < sum(each.steps for each in plan.records) < 60_000


def test_a_diagnosis_says_what_the_kinematic_rung_leaves_out(scene: SpaceScene) -> None:
    found = rw.diagnose(
        scene, "kinematic", "dynamic-rigid", inputs=[rw.Segment({"aim": 0.3}, 0.5, None, True)], tol=5e-4
    )
    assert found.body == "box"
    assert "balance" in found.causes
    assert found.details["balance"]["weight"] == pytest.approx([0.0, 0.5 * 9.81])
    assert found.details["balance"]["alone"][1] == ["table|box"]
    assert "on kinematic its weight of 4.91 is left out" in str(found)


def test_a_box_that_coasts_parts_by_inertia(scene: SpaceScene) -> None:
    # A push that ends at once: without friction the box goes on.
    inputs = [rw.Segment({"aim": 0.2}, 0.1, None, True), rw.Segment({"aim": 0.0}, 0.4)]
    found = rw.diagnose(
        scene, "quasistatic-compliant", "dynamic-compliant", inputs=inputs, tol=2e-4, parameters={"mu": 0.1}
    )
    assert found.causes == ("inertia",)
    assert found.details["inertia"]["coasted"][1] > 0.1
    assert "coasted" in str(found)


def test_friction_that_differs_is_the_cause(scene: SpaceScene) -> None:
    # The pusher goes ahead and comes back: where it slides to does not depend on friction, but how far does.
    inputs = [rw.Segment({"aim": 0.25}, 0.2, None, True), rw.Segment({"aim": 0.0}, 0.4)]
    found = rw.diagnose(
        scene, "dynamic-compliant", "dynamic-compliant", inputs=inputs, tol=2e-4,
        parameters={"mu": 0.1}, other_parameters={"mu": 0.6},
    )  # fmt: skip
    assert found.causes == ("friction",)
    assert found.details["friction"]["friction"] == [0.1, 0.6]


@pytest.mark.long
def test_plans_do_not_depend_on_threads(drawn: rw.Plan, scene: SpaceScene) -> None:
    two = rw.plan(scene, schedule=COARSE, task_seed=5, seed=3, threads=2)
    assert two.segments == drawn.segments
    assert np.array_equal(two.moves, drawn.moves)


@pytest.mark.long
def test_plans_depend_on_the_seed(drawn: rw.Plan, scene: SpaceScene) -> None:
    other = rw.plan(scene, schedule=COARSE, task_seed=5, seed=4, threads=1)
    assert other.segments != drawn.segments


@pytest.mark.long
def test_a_plan_is_saved_and_loaded(plan: rw.Plan, tmp_path: Path) -> None:
    loaded = rw.load_plan(plan.save(tmp_path / "plan.json"))
    assert loaded.text() == plan.text()
    assert np.array_equal(loaded.replay().state.q, plan.replay().state.q)


def test_a_plan_does_not_fit_a_model_that_changed(plan: rw.Plan, tmp_path: Path) -> None:
    model = tmp_path / "pusher.xml"
    model.write_text(MODEL.replace('mass=".5"', 'mass=".6"'))
    data = json.loads(plan.text())
    data["scene_file"]["model"]["file"] = str(model)
    (tmp_path / "plan.json").write_text(json.dumps(data))
    with pytest.raises(rw.PlanError, match=r"'plan\.json' belongs to another version of pusher"):
        rw.load_plan(tmp_path / "plan.json")


@pytest.mark.long
def test_instances_are_drawn_by_the_task(drawn: rw.Plan, scene: SpaceScene) -> None:
    found = rw.instances(scene, 5, count=3)
    assert [each["target"] for each in found] == [each["target"] for each in rw.instances(scene, 5, count=3)]
    assert all(0.1 <= each["target"] <= 0.3 for each in found)
    assert drawn.parameters["target"] == found[0]["target"]
    assert drawn.replay().final["box"]["x"] == pytest.approx(found[0]["target"], abs=0.01)


def test_verification_counts_samples_that_come_to_the_goal(plan: rw.Plan) -> None:
    found = rw.verify(plan, samples=12, threads=1, tol=5e-4)
    assert found.samples == 12
    assert 0 < found.successes <= 12
    assert found.successes + sum(found.failures.values()) == 12
    if found.worst:
        assert str(found.replay(found.worst[0]).outcome) == found.worst[0].outcome


def test_a_guarded_move_ends_at_the_touch(plan: rw.Plan) -> None:
    from rungwise.planning.execution.guards import guarded

    unramped = rw.Plan(
        scene=plan.scene, parameters=plan.parameters, segments=(rw.Segment({"aim": 0.2}, 0.8),),
        labels=("hold",), stage=plan.stage, tol=plan.tol,
    )  # fmt: skip
    found = guarded(unramped)
    assert found is not None
    assert [each.until for each in found.segments] == ["gap(pusher, box) <= tolerance", None]


def test_objects_are_what_nothing_drives(scene: SpaceScene) -> None:
    assert world_of(scene).roles() == {"world": "obstacle", "pusher": "robot", "box": "object"}
    task = task_of(scene)
    reach = 0.05 * np.sqrt(3.0)
    assert task.size == pytest.approx(reach)
    assert task.weights == pytest.approx([0.0, 1.0, 1.0, 1.0, *[2.0 * reach] * 4])


def test_distances_of_turns_do_not_depend_on_signs_of_quaternions(scene: SpaceScene) -> None:
    task, q = task_of(scene), rw.State.of(scene).q
    turned = rw.State.of(scene, q={"box.qw": np.cos(0.05), "box.qz": np.sin(0.05)}).q.copy()
    opposite = turned.copy()
    opposite[4:] *= -1.0
    away = task.away(np.array([q, turned, opposite]), q)
    assert away == pytest.approx([0.0, 0.1 * task.size, 0.1 * task.size], rel=1e-3)


def test_moves_go_on_as_one_run_does(scene: SpaceScene) -> None:
    work = begin(task_of(scene), Budget(), 0, 1)
    predictor = Predictor(
        scene, rw.Stage(rw.DYNAMIC_COMPLIANT, 1e-2), 5e-4, work.task.parameters, Budget(), 1
    )
    levels, durations = np.array([[[0.1], [0.2]]]), np.array([[0.3, 0.3]])
    whole = predictor.run(work.start, levels, durations, ramps=(True, True))
    half = predictor.run(work.start, levels[:, :1], durations[:, :1], ramps=(True,))
    rest = predictor.run(half.places, levels[:, 1:], durations[:, 1:], ramps=(True,))
    assert rest.places.q == pytest.approx(whole.places.q, abs=1e-4)
    assert half.work + rest.work == pytest.approx(whole.work, rel=0.05)
    assert isinstance(rest.places, Places)


@pytest.mark.parametrize(
    ("fields", "task", "words"),
    [
        (
            {}, {"transit": {"table": {"speed": 1, "clearance": 1, "push": [1, 1]}}},
            "task.transit: unknown free robot 'table'.*pusher",
        ),
        ({}, {"weights": {"box.tilt": 1.0}}, "task.weights: unknown coordinate 'box.tilt'.*box.qw"),
        ({}, {"inputs": {"mu": {"range": [0, 1]}}}, "task.inputs: unknown input 'mu'"),
        ({}, {"moves": [2, 1]}, "task.moves: must be two whole numbers"),
        ({}, {"keep_out": ["box.x >"]}, "task.keep_out.0"),
        ({}, {"reserve": 0.95}, "task.reserve: 0.95 must be"),
        ({}, {"duration": ["-mu", 1.0]}, "task.duration.0: -0.5 must be > 0"),
        ({"goal": None}, {}, "goal: the scene has none"),
        ({"inputs": []}, {"inputs": {}, "uncertain": {}}, "inputs: the scene has none"),
        ({"start": {"places": {"box.x": -0.04}}}, {}, "start: pusher and box overlap by 0.01"),
    ],
)  # fmt: skip
def test_wrong_scenes_are_told_in_one_line(
    make: Make, fields: dict[str, Any], task: dict[str, Any], words: str
) -> None:
    with pytest.raises(rw.InputError, match=words) as told:
        rw.plan(make(task, **fields), schedule=COARSE, threads=1)
    assert "\n" not in str(told.value)


QUICK: dict[str, Any] = {
    "uncertain": {"mu": {"uniform": [0.9, 1.1]}}, "duration": [0.2, 0.25], "moves": [1, 3],
    "inputs": {"aim": {"range": [0.0, 0.45], "rate": 1.0}},
}  # fmt: skip
"""Pushes after which a box coasts."""


@pytest.mark.long
def test_a_push_that_falls_short_is_planned_anew(make: Make) -> None:
    """Where friction is greater than is known a box that was to coast stays short of its target; what is
    left is another push, from where the box is."""
    scene, aim = make(QUICK), 0.174
    pushed = (rw.Segment({"aim": aim}, aim, None, True), rw.Segment({"aim": aim}, 0.3))
    plan = rw.Plan(
        scene=scene, parameters=scene.parameters(), segments=pushed, labels=("move", "hold"),
        stage=rw.Stage(rw.DYNAMIC_COMPLIANT, 1e-2), tol=2e-4,
    )  # fmt: skip
    assert plan.replay().outcome == "goal"
    open_loop, anew = (
        rw.verify(plan, samples=1, mode=mode, threads=1, tol=5e-4) for mode in ("open loop", "re-planning")
    )
    assert open_loop.successes == 0
    assert anew.successes == 1
    assert anew.mode == "re-planning"


@pytest.mark.long
def test_a_push_that_holds_is_not_planned_anew(make: Make) -> None:
    """Where friction is as known, nothing is added."""
    plan = rw.plan(make(QUICK), schedule=COARSE, threads=1)
    assert plan.found
    replanner = Replanner(plan, rw.Stage(rw.DYNAMIC_COMPLIANT, 1e-2), 5e-4, 1)
    outcome, executed = replanner.execute(plan.parameters, {}, 0)
    assert outcome == Code.GOAL
    assert len(executed) <= len(plan.segments)


def test_what_is_not_known_in_space_is_refused_by_name(plan: rw.Plan) -> None:
    with pytest.raises(rw.TaskError, match="cluster: pusher runs in threads"):
        rw.verify(plan, samples=3, cluster="tcp://127.0.0.1:1")


def test_commands_plan_verify_and_replay(
    plan: rw.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*arguments: object) -> tuple[int, Any]:
        monkeypatch.setattr(sys, "argv", ["rungwise", *map(str, arguments), "--json"])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0), json.loads(capsys.readouterr().out)

    scene, saved = tmp_path / "scene.json", tmp_path / "plan.json"
    plan.save(saved)
    scene = tmp_path / "scene.yaml"
    scene.write_text(plan.scene.stored)
    code, planned = run("plan", scene, "--schedule", "dynamic-compliant@0.01", "--task-seed", 5)
    assert code == 0
    assert planned["found"]
    code, judged = run("replay", saved, "--in", "mujoco")
    assert judged["judge"] == "mujoco"
    assert judged["outcome"] in {"goal", "missed"}
    assert code == (0 if judged["outcome"] == "goal" else 1)
    code, verified = run("verify", saved, "--samples", 4, "--threads", 1, "--rate", 0.01)
    assert verified["samples"] == 4


@pytest.mark.long
def test_three_fingers_lift_a_ball_on_rungs_with_friction_alone() -> None:
    schedule = [("kinematic", 1e-2), ("dynamic-compliant", 1e-2), ("dynamic-compliant", 1e-3)]
    plan = rw.plan("three_finger_lift", schedule=schedule, budget=60_000, seed=1, threads=1)
    assert [each.how for each in plan.records] == ["nothing found", "planned", "held"]
    kinematic = plan.diagnosis[0]
    assert kinematic.after == "kinematic @ 0.01"
    assert kinematic.body == "ball"
    assert kinematic.distance > 0.05
    assert "friction" in kinematic.causes
    assert kinematic.details["friction"]["contact"].startswith("ball|tip")
    assert kinematic.details["friction"]["friction"] == [0.6, 0.0]
    judged = rw.replay(plan.replay())
    assert judged.outcome == "goal"
    assert judged.apart.max() < 0.02


def test_mixed_worlds_take_every_kind_of_friction(tmp_path: Path) -> None:
    ball = '<body pos="0 0 .1"><freejoint/><geom size=".1" condim="6"/></body>'
    (tmp_path / "ball.xml").write_text(
        f'<mujoco><worldbody><geom type="plane" size="1 1 1"/>{ball}</worldbody></mujoco>'
    )
    frictions = {"friction": "mu", "torsional_friction": "mu / 10", "rolling_friction": "mu / 100"}
    scene = rw.load(
        {
            "name": "ball",
            "model": {"file": str(tmp_path / "ball.xml")},
            "parameters": {"mu": {"default": 0.5, "range": [0.0, 1.0]}},
            "contacts": [{"between": ["*", "*"], **frictions}],
        }
    )
    assert isinstance(scene, SpaceScene)
    one, other = (SpaceWorld(scene, {"mu": mu}, rw.DYNAMIC_RIGID, 1e-3) for mu in (0.2, 0.7))
    mixed = one.resolved(other, one, one, one)
    np.testing.assert_array_equal(mixed.bind().laws[1], other.bound.laws[1])
