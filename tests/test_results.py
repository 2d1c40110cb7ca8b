"""Results as people meet them in a console and in a notebook."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw

LONG = "a" * 60


@pytest.fixture(scope="module")
def scene() -> rw.Scene:
    return rw.load("two_finger")


@pytest.fixture(scope="module")
def run(scene: rw.Scene) -> rw.Run:
    return rw.simulate(scene, rw.KINEMATIC, step=0.01)


@pytest.fixture(scope="module")
def found(scene: rw.Scene) -> rw.FeasibleSet:
    return rw.feasible_set(scene, rw.KINEMATIC, ["v2"], tol=0.05)


def test_outcomes_are_texts(run: rw.Run) -> None:
    assert run.outcome == "goal" and run.ok and run.outcome is rw.Outcome.GOAL
    assert run.outcome.code == rw.Code.GOAL and f"{run.outcome}" == run.outcome.name == "goal"
    assert rw.Outcome("goal") is pickle.loads(pickle.dumps(run.outcome)) is copy.copy(run.outcome)
    assert json.dumps({"outcome": run.outcome}) == '{"outcome": "goal"}'
    assert {outcome.code for outcome in rw.Outcome} == set(rw.Code) == set(rw.OUTCOMES)


def test_labels_equal_their_texts(found: rw.FeasibleSet) -> None:
    assert rw.Label.FEASIBLE == "feasible" != rw.Label.DOOMED and rw.Label("jammed") is rw.Label.JAMMED
    assert (found.labels(np.array([[1.0]])) == rw.Label.FEASIBLE).all() and rw.Label.FEASIBLE == 0
    assert (found.classify(np.array([[1.0]])) == "feasible").all()
    with pytest.raises(ValueError, match="possible"):
        rw.Label("possible")


def test_outcomes_of_batches_are_texts(scene: rw.Scene) -> None:
    results = rw.Batch(scene, "kinematic", ["v2"]).run(np.array([[1.0], [0.2]]))
    assert results.outcomes.tolist() == ["goal", "doomed"]
    assert repr(results) == "<Results of 2 runs: doomed 1, goal 1>"
    rollouts = rw.rollout(scene, "kinematic", parameters={"v2": [1.0, 0.2]})
    assert rollouts.outcomes.tolist() == ["goal", "doomed"] and "doomed 1, goal 1" in repr(rollouts)


def test_texts_are_short(run: rw.Run, found: rw.FeasibleSet) -> None:
    push = rw.load("push")
    plan = rw.Plan(push, push.parameters(), reason="x" * 2000)
    many: list[Any] = [
        run, run.scene, run.state, run.model, found, plan,
        rw.ask(run.scene, "goal", run.states), rw.geometry(run.scene, run.states),
        rw.touching(run, "part"), rw.Simulation(run.scene, run.model), rw.Batch(run.scene, run.model, ["v1"]),
        rw.solve(rw.Problem(np.eye(60), np.ones(60), mu=np.ones(20))),
    ]  # fmt: skip
    for each in many:
        assert len(repr(each)) < 500 and "\n" not in repr(each), repr(each)


def test_texts_of_scenes_with_long_names_are_short() -> None:
    body = {"role": "object", "shape": {"kind": "disc", "radius": 1}, "motion": {"kind": "free"}}
    bodies = {f"{LONG[:-3]}{k:03}": body | {"pose": {"x": 3 * k}} for k in range(40)}
    scene = rw.load({"name": LONG, "bodies": bodies, "duration": 0.01})
    run = rw.simulate(scene, "kinematic")
    for each in (scene, run, run.state, run.model):
        assert len(repr(each)) < 500


def test_notebooks_show_a_table_and_the_animation(run: rw.Run, found: rw.FeasibleSet) -> None:
    text = run._repr_html_()
    assert text.startswith("<table>") and ">goal</td>" in text and "<iframe srcdoc=" in text
    assert len(text) < 2_000_000
    text = found._repr_html_()
    assert ">feasible</b>" in text and "data:image/png;base64," in text
    invalid = rw.simulate(run.scene, run.model, parameters={"travel": 0.3})
    assert "overlaps part" in invalid._repr_html_() and "iframe" not in invalid._repr_html_()


def test_pictures(run: rw.Run, found: rw.FeasibleSet, tmp_path: Path) -> None:
    for name, figure in (("run", run.plot()), ("one", run.plot(frames=1)), ("set", found.plot())):
        figure.savefig(tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 5000
    invalid = rw.simulate(run.scene, run.model, parameters={"travel": 0.3})
    push = rw.load("push")
    for call, words in (
        (lambda: rw.plot(3), "plot: must be a run, a plan, a set or a design, not 3"),  # type: ignore[arg-type]
        (lambda: run.plot(0), "frames: must be a whole number in 1..100, not 0"),
        (invalid.plot, "plot: the run did not begin: "),
        (rw.Plan(push, push.parameters(), reason="none").plot, "plot: there is no plan: none"),
    ):
        with pytest.raises(rw.PictureError, match=words):
            call()


def test_public_names_and_no_others() -> None:
    assert dir(rw) == sorted(rw.__all__) and not [name for name in dir(rw) if name.startswith("_")]
    assert (Path(rw.__file__).parent / "py.typed").is_file()
