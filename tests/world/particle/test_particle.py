"""A world of one folder goes through everything that knows the contract of a world; what is not possible
for it ends in one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import rungwise as rw
from rungwise import gym
from rungwise.cli import app
from rungwise.world.find import world_of

from . import ParticleScene

FILE = Path(__file__).parent / "scene.yaml"
MOVING = rw.LADDER[1:]


@pytest.fixture(autouse=True, scope="module")
def known() -> None:
    rw.add_world("particle", __package__ or "")


@pytest.fixture(scope="module")
def scene() -> ParticleScene:
    found = rw.load(FILE)
    assert isinstance(found, ParticleScene)
    return found


@pytest.fixture(scope="module")
def plan(scene: ParticleScene) -> rw.Plan:
    found = rw.plan(scene, to=rw.DYNAMIC_RIGID, budget=200_000, threads=1)
    assert found.found, found.reason
    return found


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
def test_a_finger_brings_the_puck_to_its_goal(scene: ParticleScene, rung: rw.Rung) -> None:
    run = rw.simulate(scene, rung)
    assert run.ok
    # The finger meets the puck after 0.3 and takes it 0.4 further, at a speed of 0.8; a compliant contact
    # yields by its damper's force over its stiffness.
    assert run.time == pytest.approx(0.7 / 0.8, abs=2e-3)
    assert run.final["puck"]["x"] - run.final["finger"]["x"] == pytest.approx(0.2, abs=1e-3)
    assert run.worst_residual < 1e-9


def test_a_free_puck_falls_as_its_field_and_drag_say(scene: ParticleScene) -> None:
    """x'' = -x - x' from x = 0.5 on, in closed form."""
    begin = rw.State.of(scene, {"puck.x": 0.3}, parameters={"vx": 0.0})
    run = rw.simulate(
        scene, rw.DYNAMIC_RIGID, parameters={"vx": 0.0, "at": -1.0}, state=begin, inputs=[], duration=1.0,
        tol=1e-6,
    )  # fmt: skip
    w = np.sqrt(0.75)
    wanted = 0.3 * np.exp(-0.5) * (np.cos(w) + 0.5 / w * np.sin(w))
    assert run.final["puck"]["x"] == pytest.approx(wanted, abs=1e-3)


def test_a_quasistatic_puck_rests_where_loads_balance(scene: ParticleScene) -> None:
    run = rw.simulate(
        scene, rw.QUASISTATIC_RIGID, parameters={"vx": 0.0}, state=None, inputs=[], duration=1.0
    )
    assert run.final["puck"]["x"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
def test_runs_go_on_from_their_states_bit_for_bit(
    scene: ParticleScene, rung: rw.Rung, tmp_path: Path
) -> None:
    whole = rw.simulate(scene, rung)
    state = rw.load_state(whole.states[500].save(tmp_path / "state.npz"))
    again = rw.simulate(scene, rung, state=state)
    assert np.array_equal(again.state.q, whole.state.q) and np.array_equal(again.state.v, whole.state.v)
    assert again.time == whole.time
    other = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, state=state)
    assert other.ok


def test_inputs_over_time_and_conditions(scene: ParticleScene) -> None:
    until = rw.Segment({"vx": 1.0}, 1.0, "gap(finger, puck) <= 0")
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, inputs=[until, rw.Segment({"vx": 0.0}, 0.2, ramp=True)])
    assert run.time == pytest.approx(0.5, abs=2e-3)
    # A ramp from 1 to 0 over 0.2 goes 0.1 far.
    assert run.final["finger"]["x"] == pytest.approx(-0.1, abs=2e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
@pytest.mark.parametrize("tol", [None, 1e-3])
def test_conditions_that_must_hold_for_a_time(scene: ParticleScene, rung: rw.Rung, tol: float | None) -> None:
    """The finger comes to -0.3 at 0.25; it rests where its speed times the step is within the tolerance."""
    made = scene.changed(goal="finger.x >= -0.3 for 0.2", unsafe=None)
    assert rw.simulate(made, rung, tol=tol).time == pytest.approx(0.45, abs=1e-9)
    assert not rw.simulate(scene.changed(goal="abs(finger.x + 0.3) <= 0.04 for 0.11"), rung, tol=tol).ok
    rest = scene.changed(goal="rest(finger) for 0.25", tolerance=1e-4)
    assert rw.simulate(rest, rung, tol=tol, parameters={"vx": 0.09}).time == pytest.approx(0.25, abs=1e-9)
    assert not rw.simulate(rest, rung, tol=tol, parameters={"vx": 0.11}).ok
    until = [rw.Segment({"vx": 0.8}, 1.0, "finger.x >= -0.3 for 0.1"), rw.Segment({"vx": 0.0}, 0.05)]
    assert rw.simulate(scene, rung, tol=tol, inputs=until).time == pytest.approx(0.4, abs=1e-9)


def test_runs_at_many_points_and_from_states(scene: ParticleScene) -> None:
    found = rw.Batch(scene, rw.KINEMATIC, ("vx", "vy")).run(np.array([[0.8, 0.0], [0.1, 0.0], [9.0, 0.0]]))
    assert found.outcomes.tolist() == ["goal", "timeout", "invalid"]
    state = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.3).state
    rolled = rw.rollout(
        scene, rw.DYNAMIC_RIGID, [state] * 2, {"vx": [[0.5, 0.6], [0.7, 0.2]]}, [0.2, 0.3], threads=1
    )
    again = rolled.run(1)
    assert np.allclose(rolled.final[1], again.state.q, rtol=0.0, atol=0.0)
    assert rolled.state(0).time == pytest.approx(0.8)


def test_questions_at_states(scene: ParticleScene) -> None:
    run = rw.simulate(scene, rw.DYNAMIC_RIGID)
    assert rw.ask(scene, "goal", run.state).holds[0]
    assert rw.ask(scene, "force(finger, puck) >= 0.3", run.state).holds[0]
    there = rw.geometry(scene, run.state)
    assert there.gaps[0].tolist() == pytest.approx([0.0, 0.5, 0.7], abs=1e-6)
    over = rw.State.of(scene, {"finger.x": -0.1})
    assert rw.geometry(scene, over).collides[0]
    assert "overlap" in rw.simulate(scene, rw.DYNAMIC_RIGID, state=over).reason


def test_sets_over_parameters_and_states(scene: ParticleScene, tmp_path: Path) -> None:
    found = rw.feasible_set(scene, rw.KINEMATIC, ("vx", "at"), tol=0.1, threads=1)
    # In 2 the finger has to go -at + 0.2 far: the puck, 0.2 ahead of it, is then at 0.4.
    points = np.array([[0.5, -0.5], [0.2, -0.5], [0.9, -0.9], [0.45, -0.9]])
    assert found.classify(points).tolist() == ["feasible", "infeasible", "feasible", "infeasible"]
    found.save(tmp_path / "set")
    assert rw.load_set(tmp_path / "set").volumes() == found.volumes()
    with pytest.raises(rw.SceneError, match="only the slowest motion is known"):
        rw.feasible_set(scene, rw.KINEMATIC, ("vx",), solutions="possible")


@pytest.mark.long
def test_a_puck_beyond_its_goal_is_lost_and_no_other(scene: ParticleScene) -> None:
    """A finger that only goes forward takes nothing back: behind the puck, the set is puck.x > 0.6 whatever
    the finger does. Ahead of the puck it leaves the box, which counts as reaching the goal."""
    box = {"puck.x": (0.3, 0.9), "finger.x": (0.1, 0.7)}
    found = rw.doomed_set(
        scene, rw.KINEMATIC, ("puck.x", "finger.x"), {"vx": (0.2, 1.0)}, box=box, cells=(16, 12), threads=1
    )
    points = np.random.default_rng(5).uniform(*found.box.T, (20_000, 2))
    points = points[np.abs(points[:, 0] - points[:, 1]) >= 0.2]
    lost = found.classify(points) == "doomed"
    behind = points[:, 1] < points[:, 0]
    assert not lost[~behind | (points[:, 0] <= 0.6)].any()
    assert lost[behind & (points[:, 0] > 0.6 + 1.01 * found.unit[0])].all()


@pytest.mark.long
def test_plans_are_found_saved_verified_and_diagnosed(
    scene: ParticleScene, plan: rw.Plan, tmp_path: Path
) -> None:
    again = rw.load_plan(plan.save(tmp_path / "plan.json"))
    assert again.scene.content == scene.content and again.replay().ok
    assert rw.verify(again, samples=4, threads=1).successes == 4
    assert rw.verify(again, samples=2, mode="re-planning", threads=1).samples == 2
    found = rw.diagnose(
        scene, rw.KINEMATIC, rw.DYNAMIC_RIGID, inputs=plan.segments, parameters=plan.parameters
    )
    assert found.outcome == "goal" and set(found.causes) <= {"balance", "friction", "inertia"}
    # With duration enough and nothing that holds it, the puck comes back on rungs with forces alone.
    away = [rw.Segment({"vx": 0.8}, 0.7), rw.Segment({"vx": -1.0}, 0.6)]
    parts = rw.diagnose(scene, rw.KINEMATIC, rw.DYNAMIC_RIGID, inputs=away)
    assert "balance" in parts.causes and parts.body == "puck"


def test_rungs_are_compared_as_far_as_nothing_is_matched(scene: ParticleScene) -> None:
    found = rw.compare(scene, rw.DYNAMIC_RIGID, samples=0, threads=1)
    assert found.notes == ("nothing is matched",)
    assert all(not measured.fits for measured in found.pairs)


def test_environments(scene: ParticleScene) -> None:
    env = gym.make(scene, rw.DYNAMIC_RIGID, observe=("q", "v", "forces", "inputs"))
    env.reset(seed=1)
    for _ in range(5):
        env.step(np.array([1.0, 0.0], np.float32))
    assert np.array_equal(env.replay().state.q, env.state.q)
    assert env.instance["at"] != scene.parameters()["at"]


def led_through_free_space(scene: rw.Scene) -> object:
    led = {"finger": {"speed": 1, "clearance": 0.1, "push": [0.1, 0.2]}}
    return rw.load(scene.file.model_dump(exclude_unset=True) | {"task": {"transit": led}})


NOT_POSSIBLE: dict[str, Callable[[rw.Plan, Path], object]] = {
    "view": lambda plan, out: rw.view(plan, html=out / "a.html"),
    "view a run": lambda plan, out: rw.view(plan.replay(), html=out / "a.html"),
    "view a folder": lambda plan, out: rw.view(plan.replay().save(out / "run"), html=out / "a.html"),
    "plot": lambda plan, _: rw.plot(plan),
    "touching": lambda plan, _: rw.touching(plan.replay(), "puck"),
    "replay": lambda plan, _: rw.replay(plan.replay()),
    "derivatives": lambda plan, _: rw.run_sensitivity(
        plan.scene, rw.DYNAMIC_RIGID, plan.parameters, steps=2
    ),
    "pictures": lambda plan, _: gym.make(plan.scene, rw.KINEMATIC, render_mode="rgb_array"),
    "motion": lambda plan, _: rw.simulate(plan.scene, rw.KINEMATIC, motion={"puck.x": 1.0}),
    "transit": lambda plan, _: led_through_free_space(plan.scene),
}  # fmt: skip


def test_a_notebook_shows_its_runs_as_a_table(plan: rw.Plan) -> None:
    text = plan.replay()._repr_html_()
    assert text.startswith("<table>") and "puck.x" in text and "iframe" not in text


@pytest.mark.parametrize("what", NOT_POSSIBLE)
def test_what_is_not_possible_ends_in_one_line(what: str, plan: rw.Plan, tmp_path: Path) -> None:
    with pytest.raises(rw.InputError) as error:
        NOT_POSSIBLE[what](plan, tmp_path)
    assert "\n" not in str(error.value) and len(str(error.value)) > 10


def test_saved_runs_are_known_by_the_world_of_their_scene(scene: ParticleScene, tmp_path: Path) -> None:
    rw.simulate(scene, rw.KINEMATIC, duration=0.01).save(tmp_path / "run")
    with pytest.raises(rw.ViewError, match=r"no pictures of runs in .*, the world of puck"):
        rw.view(tmp_path / "run", html=tmp_path / "a.html")


def test_commands_take_its_files(tmp_path: Path) -> None:
    for command in (
        ["check", str(FILE)],
        ["sim", str(FILE), "--model", "dynamic-rigid", "--json", "--out", str(tmp_path / "run")],
        ["sets", str(FILE), "--model", "kinematic", "--over", "vx,at", "--tol", "0.2"],
    ):
        found = CliRunner().invoke(app, command)
        assert found.exit_code == 0, found.output
    assert CliRunner().invoke(app, ["view", str(tmp_path / "run")]).exit_code == 2


def test_no_file_makes_the_package_import_a_module() -> None:
    for name in ("os", "tests.world.particle", "rungwise.world.planar", 3, ["particle"], None):
        with pytest.raises(rw.SceneError, match="world: unknown"):
            rw.load({"world": name, "name": "puck"})
    with pytest.raises(rw.SceneError, match=r"finger: is required"):
        rw.load({"world": "particle", "name": "puck", "speed": ["vx", "vy"]})


def test_the_recipe_counts_its_files() -> None:
    """A world is one folder: what it says of bodies, and fields and names."""
    assert {file.name for file in Path(__file__).parent.glob("*")} - {"__pycache__"} == {
        "__init__.py", "system.py", "scene.yaml", "test_particle.py",
    }  # fmt: skip
    assert world_of(rw.load(FILE)).roles() == {"puck": "object", "finger": "robot", "wall": "obstacle"}


def test_steps_have_no_derivatives(scene: ParticleScene) -> None:
    with pytest.raises(rw.ModelError, match="derivatives of steps do not work for puck"):
        world_of(scene).slopes(scene.parameters(None), 0.1, 0.01)
