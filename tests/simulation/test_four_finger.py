"""The four-finger grasp (the paper's Figure 2): closure, the ways to fail, and symmetry."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.analysis.closure import check

from .conftest import MOVING

RIGID = (rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID)
FALL = {"v2": 0.85, "mu": 0.2, "x": 0.1, "y": 0.12, "angle": 0.08}


@pytest.fixture(scope="module")
def scene() -> rw.Scene:
    return rw.load("four_finger")


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_fingers_close_on_the_part(scene: rw.Scene, model: rw.Rung) -> None:
    run = rw.simulate(scene, model, parameters=FALL)
    assert run.outcome.name == "goal" and run.worst_residual <= 1e-8
    held = rw.touching(run, "part")
    assert sorted(held.others) == ["fixed_left", "fixed_right", "left", "right"]
    closure = rw.form_closure(held.points, held.normals)
    assert closure and check(closure)
    assert rw.force_closure(held.points, held.normals, held.friction)
    # Where the fingers stand decides where the part is: on the goal edge, x = (v1 - v2) t / 2.
    expected = 0.5 * (1.0 - 0.85) * run.time
    assert run.final["part"]["x"] == pytest.approx(expected, abs=2e-3)
    early = rw.simulate(scene, model, parameters=FALL, duration=1.0)
    touching = rw.touching(early, "part")
    assert not rw.form_closure(touching.points, touching.normals)


@pytest.mark.parametrize(
    ("model", "change", "outcome"),
    [
        (rw.DYNAMIC_RIGID, {"v2": 0.4}, "missed"),
        (rw.DYNAMIC_RIGID, {"mu": 1.2}, "jammed"),
        (rw.DYNAMIC_COMPLIANT, {"mu": 1.2}, "model_invalid"),
        # Three contacts wedge the part: their forces grow as 1 / (t' - t), and no step leads past t'.
        (rw.DYNAMIC_RIGID, {"v2": 0.65, "drag": 0.0}, "jammed"),
        (rw.DYNAMIC_RIGID, {"v2": 0.54, "mu": 0.0, "drag": 0.0}, "goal"),
        (rw.DYNAMIC_RIGID, {"v2": 0.54, "mu": 0.0, "drag": 0.0, "restitution": 1.0}, "missed"),
        (rw.QUASISTATIC_RIGID, {"x": 1.3, "y": 0.4, "angle": 0.0}, "missed"),
        (rw.QUASISTATIC_RIGID, {"angle": 0.6}, "invalid"),
    ],
)
def test_ways_to_fail(scene: rw.Scene, model: rw.Rung, change: dict[str, float], outcome: str) -> None:
    """By speed, friction, restitution and position error."""
    run = rw.simulate(scene, model, parameters={**FALL, **change}, frames=3)
    assert run.outcome.name == outcome, run.reason
    if outcome == "jammed":
        assert run.certificate is not None and run.certificate.kind == "frictional"


def test_a_wedge_that_throws_the_part_ever_faster_is_a_jam(scene: rw.Scene) -> None:
    """Without friction three fingers press the part into a singular position, a million times faster than
    they close."""
    parameters = {
        "v2": 0.4012458644354835,
        "mu": 0.0,
        "restitution": 0.6911686486284445,
        "x": -0.3995305316999105,
        "y": 0.05680456109513475,
        "angle": -0.29642110993741577,
    }
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, parameters=parameters, frames=3)
    assert run.outcome.name == "jammed", run.reason
    assert run.certificate is not None and run.certificate.kind == "kinematic"
    assert run.final["part"]["angle"] == pytest.approx(-np.pi / 4, abs=1e-6)


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_mirrored_starts_give_mirrored_runs(scene: rw.Scene, model: rw.Rung) -> None:
    rng = np.random.default_rng(2)
    compared = 0
    for _ in range(8):
        one = {
            "v1": 1.0,
            "v2": float(rng.uniform(0.7, 1.3)),
            "mu": float(rng.uniform(0.0, 0.4)),
            "x": float(rng.uniform(-0.2, 0.2)),
            "y": float(rng.uniform(0.1, 0.3)),
            "angle": float(rng.uniform(-0.1, 0.1)),
        }
        other = {**one, "v1": one["v2"], "v2": one["v1"], "x": -one["x"], "angle": -one["angle"]}
        a, b = (rw.simulate(scene, model, parameters=p, frames=3, step=1e-3) for p in (one, other))
        assert a.outcome.name == b.outcome.name and a.time == pytest.approx(b.time, rel=1e-6)
        x, y = a.final["part"], b.final["part"]
        assert (x["x"], x["y"], x["angle"]) == pytest.approx((-y["x"], y["y"], -y["angle"]), abs=1e-6)
        compared += a.outcome.name == "goal"
    assert compared >= 4


@pytest.mark.few(3)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_every_outcome_has_a_reason_and_every_goal_is_a_closure(scene: rw.Scene, model: rw.Rung) -> None:
    rng = np.random.default_rng(17)
    for _ in range(6):
        parameters = {
            "v2": float(np.exp(rng.uniform(-1.0, 1.0))),
            "mu": float(rng.uniform(0.0, 1.2)),
            "restitution": float(rng.uniform(0.0, 1.0)),
            "x": float(rng.uniform(-0.4, 0.4)),
            "y": float(rng.uniform(0.0, 0.3)),
            "angle": float(rng.uniform(-0.3, 0.3)),
        }
        run = rw.simulate(scene, model, parameters=parameters, frames=3, step=2e-3)
        assert run.outcome.name != "not_converged", (parameters, run.reason)
        assert run.worst_residual <= 1e-8
        if run.outcome.name == "goal":
            held = rw.touching(run, "part")
            assert rw.form_closure(held.points, held.normals)


@pytest.mark.parametrize("step", [4e-4, 2e-4, 1e-4])
def test_a_wedged_part_is_not_pressed_through_its_fingers(scene: rw.Scene, step: float) -> None:
    """Tilted between three fingers, it turns ever faster as it jams; overlap must not add up meanwhile."""
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, parameters={**FALL, "v2": 0.65, "drag": 0.0}, step=step)
    assert run.outcome.name == "jammed"
    assert float(run.trajectory.gap.min()) > -1e-5
    assert run.final["part"]["x"] == pytest.approx(0.31777, abs=5e-4)
    assert run.final["part"]["angle"] == pytest.approx(0.02097, abs=5e-4)


def test_wrong_body(scene: rw.Scene) -> None:
    run = rw.simulate(scene, rw.KINEMATIC, duration=0.1)
    with pytest.raises(ValueError, match="body: unknown 'zzz'; valid: left, right, part"):
        rw.touching(run, "zzz")
