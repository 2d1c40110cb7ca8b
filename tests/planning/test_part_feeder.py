"""The part feeder: cups leave closed end down whichever way they came, because of the pin."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.design import design, optimise

TOL = 1e-4


def cups(samples: int, seed: int) -> dict[str, np.ndarray]:
    """Arrivals drawn as the task says."""
    task, rng = rw.load("part_feeder").file.task, np.random.default_rng(seed)
    assert task is not None
    return {name: rng.uniform(*spread.uniform, samples) for name, spread in task.uncertain.items()}


@pytest.mark.few(1)
@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
def test_fresh_cups_leave_closed_end_down(model: str) -> None:
    drawn = cups(50, 7)
    found = rw.rollout("part_feeder", model, parameters=drawn, tol=TOL, keep=False)
    assert 15 < np.sum(drawn["arrival"] > 0.0) < 35
    assert np.sum(found.outcomes == "goal") >= (50 if model == "dynamic-compliant" else 47)


def test_a_pin_that_is_out_of_reach_turns_no_cup() -> None:
    """Both tip over the lip, clockwise, by less than a quarter turn: open end first they leave so."""
    far = {"pin_x": 0.9, "exit": 0.9, "drop": 0.09}
    both = rw.rollout("part_feeder", "dynamic-compliant", parameters=far | {"arrival": [1.0, -1.0]}, tol=TOL)
    assert list(both.outcomes) == ["goal", "doomed"]
    turned = both.final[:, 2] - np.array([-0.5, np.pi - 0.5])
    assert np.all((-np.pi / 2 < turned) & (turned < 0.0))


def test_no_cup_gains_energy() -> None:
    """v² / 2 and the energy of rotation are at most what gravity gave, whatever the restitution."""
    drawn = cups(20, 3)
    found = rw.rollout("part_feeder", "dynamic-compliant", parameters=drawn, tol=TOL)
    scene = rw.load("part_feeder")
    for k in range(20):
        one = {name: float(values[k]) for name, values in drawn.items()}
        cup = scene.bind(scene.parameters(one)).records.bodies[0]
        height = rw.simulate(scene, "dynamic-compliant", parameters=one, duration=1e-9).final["cup"]["y"]
        vx, vy, spin = found.speed[k]
        kinetic = 0.5 * (vx**2 + vy**2) + 0.5 * cup.inertia / cup.mass * spin**2
        gained = 0.5 * one["v"] ** 2 + 9.81 * (height - found.final[k, 1])
        assert kinetic <= gained * (1.0 + 1e-3)


@pytest.mark.parametrize("model", ["quasistatic-rigid", "quasistatic-compliant"])
def test_a_cup_that_falls_is_nothing_for_quasistatic_rungs(model: str) -> None:
    assert rw.simulate("part_feeder", model, tol=TOL).outcome == "unsupported"


@pytest.mark.long
def test_a_climb_skips_rungs_on_which_cups_cannot_fall(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says why, and the search goes on from the design of dynamic-rigid."""
    monkeypatch.setattr(design, "DESIGNS", 4)
    monkeypatch.setattr(optimise, "SCAN", 3)
    monkeypatch.setattr(optimise, "HALVINGS", 0)
    found = rw.design(
        "part_feeder", ("pin_x", "pin_y"), from_="quasistatic-rigid", robust=True, draws=8, samples=30,
        budget=1, box={"pin_x": (0.036, 0.041), "pin_y": (-0.016, -0.006)}, accuracy=TOL,
    )  # fmt: skip
    names = [each.model.name for each in found.earlier]
    assert names == ["quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid"]
    assert [each.rate > 0.0 for each in found.earlier] == [False, False, True]
    assert all(set(each.outcomes) == {"unsupported"} for each in found.earlier[:2])
    assert "quasistatic-rigid: skipped" in str(found) and "unsupported" in str(found)
    assert found.successes >= 26
