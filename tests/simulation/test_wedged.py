"""Rollouts of pushes that wedge a box against a post end as runs do, and after about as many steps; cups that
are wedged come to rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.judge.certificate import check

TOL = 7.071067811865475e-05
START = {"goal_x": 1.0, "apart": 0.02, "offset": 0.0}


def compare(found: rw.Rollouts, least: int) -> None:
    """Jams of rollouts are jams of runs, at the same place, after not many more attempts at steps."""
    jammed = np.flatnonzero(found.outcome == rw.Code.JAMMED)
    assert len(jammed) >= least
    for i in jammed:
        run = found.run(int(i))
        assert run.outcome.code == rw.Code.JAMMED, (i, run.reason)
        assert found.attempts[i] <= 3 * run.attempts + 100, i
        places = [x for body in run.final.values() for x in body.values()]
        assert found.final[i] == pytest.approx(places, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("count", [8, pytest.param(25, marks=pytest.mark.long)])
def test_wedged_boxes_end_rollouts(count: int) -> None:
    rng = np.random.default_rng(7)
    posts = {"post1_x": rng.uniform(0.118, 0.125, count), "post1_y": rng.uniform(0.042, 0.05, count)}
    turns = np.array([0.887, -0.504]) + rng.uniform(-0.1, 0.1, (count, 2))
    heading = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    found = rw.rollout(
        "push", "quasistatic-rigid", inputs=heading, durations=[1.346, 6.0], parameters=START | posts,
        tol=TOL, threads=1,
    )  # fmt: skip
    compare(found, count // 4)


def test_a_jam_is_told_where_other_short_steps_stand_between_the_refused_ones() -> None:
    """A draw that takes a thousand attempts if one such step makes up for one without solution."""
    rng, draw = np.random.default_rng(8), slice(83, 84)
    posts = {"post1_x": rng.uniform(0.118, 0.125, 100)[draw], "post1_y": rng.uniform(0.042, 0.05, 100)[draw]}
    turns = (np.array([0.887, -0.504]) + rng.uniform(-0.1, 0.1, (100, 2)))[draw]
    heading = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    found = rw.rollout(
        "push", "quasistatic-rigid", inputs=heading, durations=[1.346, 6.0], parameters=START | posts,
        tol=TOL, threads=1,
    )  # fmt: skip
    compare(found, 1)


def test_a_box_that_gives_way_by_parts_of_the_tolerance_does_not_go_on_for_long() -> None:
    """Here each step that has a solution moves the box by some hundredths of the tolerance, in place of a
    longer one without: thousands of them before nothing moves."""
    at = START | {"post1_x": 0.12132715515343598, "post1_y": 0.045899312196799685}
    heading = [[[0.631427183782538, 0.7754351756146048], [0.8755964316005573, -0.48304336137490866]]]
    durations = [1.3461568045077035, 4.398193643920042]
    found = rw.rollout(
        "push", "quasistatic-rigid", inputs=heading, durations=durations, parameters=at, tol=TOL, threads=1
    )
    compare(found, 1)


@pytest.mark.long
@pytest.mark.parametrize(("tol", "most"), [(TOL, 1000), (None, 2000)])
def test_cups_wedged_between_pin_and_chute_come_to_rest(tol: float | None, most: int) -> None:
    """Bodies that hold a cup on all sides, and overlap it by rounding, cannot come apart, and are held. Pins
    and cups are random."""
    scene, rng = rw.load("part_feeder"), np.random.default_rng(5)
    assert scene.file.task is not None
    drawn = {name: rng.uniform(*spread.uniform, 400) for name, spread in scene.file.task.uncertain.items()}
    drawn |= {"pin_x": rng.uniform(0.015, 0.045, 400), "pin_y": rng.uniform(-0.025, 0.015, 400)}
    found = rw.rollout("part_feeder", "dynamic-rigid", parameters=drawn, tol=tol, keep=False, budget=most)
    assert not np.isin(found.outcomes, ["not_converged", "jammed"]).any()


def blocks_apart(seed: int) -> dict[str, Any]:
    """Blocks between two walls, and a wedge at a given speed between the first two."""
    rng = np.random.default_rng(seed)
    count, mu = int(rng.integers(3, 6)), rng.uniform(0.2, 1.0)
    widths = rng.uniform(0.8, 1.2, count)
    widths *= 2.0 / widths.sum()
    bodies: dict[str, Any] = {
        name: {"role": "obstacle", "shape": {"kind": "halfplane", "normal": normal}, "pose": {"x": x}}
        for name, normal, x in (("left", [1, 0], -1.0), ("right", [-1, 0], 1.0), ("floor", [0, 1], 0.0))
    }
    for i, (width, end) in enumerate(zip(widths, np.cumsum(widths) - 1.0, strict=True)):
        corners = [[0, 0], [width - 1e-4, 0], [width - 0.05, 0.5], [0.05, 0.5]]
        bodies[f"block{i}"] = {
            "role": "object", "mass": 1.0, "shape": {"kind": "polygon", "vertices": corners},
            "pose": {"x": end - width + 5e-5}, "motion": {"kind": "free"},
        }  # fmt: skip
    bodies["wedge"] = {
        "role": "robot", "shape": {"kind": "regular", "corners": 3, "reach": 0.3},
        "pose": {"x": widths[0] - 1.0, "y": 0.85, "angle": -0.5 * np.pi},
        "motion": {"kind": "slide", "axis": [0, -1], "name": "d"},
        "coordinates": {"d": {"drive": {"kind": "speed", "speed": 0.1}}},
    }  # fmt: skip
    contacts = [{"between": ["*", "*"], "friction": mu}]
    return {
        "name": "apart", "gravity": [0, -9.0], "bodies": bodies, "contacts": contacts, "duration": 6.0,
        "step": 0.005, "goal": "wedge.d >= 0.4", "tolerance": 10.0 ** rng.uniform(-12, -6),
    }  # fmt: skip


@pytest.mark.parametrize(("first", "count"), [(1, 6), pytest.param(0, 24, marks=pytest.mark.long)])
def test_what_friction_holds_against_a_wedge_jams_with_a_proof(first: int, count: int) -> None:
    """Also without momentum, where nearly no inertia stands against the loads."""
    jams = open_ = 0
    for seed in range(first, first + count):
        run = rw.simulate(blocks_apart(seed), "quasistatic-rigid", frames=3)
        open_ += run.outcome == "not_converged"
        if run.outcome == "jammed":
            jams += 1
            assert run.certificate is not None and run.problem is not None
            assert check(run.problem, run.certificate)
    assert jams >= count / 2 and open_ <= 0.1 * count
