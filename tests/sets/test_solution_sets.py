"""Possible and guaranteed sets against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.sets.motions import Motions, motions
from rungwise.world.batch import Batch

from .test_feasible import BOX, worst


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [0.02, pytest.param(0.006, marks=pytest.mark.long)])
@pytest.mark.parametrize("model", [rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT], ids=str)
def test_three_bands_of_one_call(model: rw.Rung, tol: float) -> None:
    """The slowest motion catches at r in [1/2, 2]. At the first contact, x1 = 3/2, the part may go at once to
    where it meets finger 2, x3 = 3/2 - x2: it is between the fingers, x3 <= 1/2, iff r >= 2/3."""
    found = rw.solution_sets("two_finger", model, ("v1", "v2"), box=BOX, tol=tol, threads=1)
    for each, end in ((found.slowest, 0.5), (found.possible, 0.5), (found.guaranteed, 2.0 / 3.0)):
        assert each.complete and each.hits == 0
        assert worst(each, end) <= tol


@pytest.mark.parametrize("offset", [0.3, 0.5, 0.7])
def test_guaranteed_band_of_other_fingers(offset: float) -> None:
    """Contact at x1 = travel - height + offset = 1 + offset; caught iff x2 >= 1 then."""
    found = rw.feasible_set(
        "two_finger", rw.QUASISTATIC_RIGID, ("v2",), box={"v2": (0.2, 2.2)}, tol=1e-3, threads=1,
        parameters={"offset": offset}, solutions="guaranteed",
    )  # fmt: skip
    v2 = np.linspace(0.2, 2.2, 20_001)
    caught = v2[found.labels(v2[:, None]) == rw.Label.FEASIBLE]
    assert (caught.min(), caught.max()) == pytest.approx((1.0 / (1.0 + offset), 1.0 + offset), abs=2e-3)


def at_the_wall() -> rw.Scene:
    """A finger pushes a block from s = 0.5 on; the goal is between two places, the wall at 2."""
    bodies = {
        "block": {
            "role": "object", "mass": 1, "shape": {"kind": "point"}, "pose": {"x": 0.5},
            "motion": {"kind": "slide", "axis": [1, 0]}, "coordinates": {"s": {"dry_friction": "hold"}},
        },
        "finger": {
            "role": "robot", "shape": {"kind": "halfplane", "normal": [1, 0]},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1.0}}},
        },
        "wall": {"role": "obstacle", "pose": {"x": 2}, "shape": {"kind": "halfplane", "normal": [-1, 0]}},
    }  # fmt: skip
    return rw.load(
        {
            "name": "wall",
            "parameters": {
                "low": {"default": 0.0, "range": [-1.0, 3.0]}, "high": {"default": 3.0, "range": [-1.0, 3.0]},
                "hold": {"default": 0.0, "range": [0.0, 9.0]},
            },
            "bodies": bodies,
            "contacts": [{"between": ["finger", "block"]}, {"between": ["block", "wall"]}],
            "goal": "t >= 1 and block.s >= low and block.s <= high",
            "duration": 1.1,
            "step": 1e-3,
        }
    )  # fmt: skip


def test_where_the_slowest_motion_is_no_bound() -> None:
    """The block is at 0.5 to 0.6 when it goes as the finger does, or at the wall, 1.5 from its start."""
    found = rw.solution_sets(
        at_the_wall(), rw.QUASISTATIC_RIGID, ("low",), box={"low": (0.1, 2.9)}, tol=1e-3, threads=1
    )
    ends = []
    for each in (found.slowest, found.possible, found.guaranteed):
        low = np.linspace(0.1, 2.9, 28_001)
        ends.append(float(low[each.labels(low[:, None]) == rw.Label.FEASIBLE].max()))
    assert ends == pytest.approx([0.6, 1.5, 0.6], abs=3e-3)
    witness = found.possible.witness(np.array([1.0]))
    assert witness is not None
    run = found.possible.replay(witness)
    assert run.outcome.name == "goal" and run.motion == {"block.s": 1000.0}
    assert found.slowest.replay(witness).outcome.name != "goal"
    run = found.guaranteed.replay({"low": 0.2, "high": 1.0})
    assert run.outcome.name != "goal" and run.motion == {"block.s": 1000.0}


def test_friction_leaves_one_motion() -> None:
    options = {"box": {"low": (0.1, 2.9)}, "tol": 0.01, "threads": 1, "parameters": {"hold": 1.0}}
    found = rw.solution_sets(at_the_wall(), rw.QUASISTATIC_RIGID, ("low",), **options)
    low = np.linspace(0.1, 2.9, 1000)[:, None]
    assert (found.slowest.labels(low) == found.possible.labels(low)).all()
    assert (found.slowest.labels(low) == found.guaranteed.labels(low)).all()


def test_margins_are_those_of_the_motion_nearest_to_another_verdict() -> None:
    """Where all motions reach the goal the least counts, where none does the greatest."""
    scene, points, over = rw.load("two_finger"), np.array([[0.35], [0.9], [1.2]]), ("v2",)
    alone = [
        Batch(scene, rw.KINEMATIC, over, motion=each).run(points) for each in motions(scene, rw.KINEMATIC)
    ]
    margins = np.array([each.margin for each in alone])
    assert [set(each.outcome == rw.Code.GOAL) for each in alone] == [{False, True}] * 3
    assert (np.ptp(margins, axis=0) > 1e-3).any()
    sure = Motions(scene, rw.KINEMATIC, over, "guaranteed").run(points).margin
    maybe = Motions(scene, rw.KINEMATIC, over, "possible").run(points).margin
    np.testing.assert_array_equal(sure[1:], margins.min(axis=0)[1:])
    assert maybe[0] == margins.max(axis=0)[0]


def test_extremes() -> None:
    scene = rw.load("two_finger")
    assert [dict(m) for m in motions(scene, rw.KINEMATIC)] == [{}, {"part.x3": -1e3}, {"part.x3": 1e3}]
    assert len(motions(rw.load("four_finger"), rw.QUASISTATIC_RIGID)) == 7
    for model, solutions in ((rw.DYNAMIC_RIGID, "possible"), (rw.KINEMATIC, "slowest")):
        assert motions(scene, model, solutions) == ({},)


def test_kept_and_read_again(tmp_path: Path) -> None:
    found = rw.solution_sets("two_finger", rw.KINEMATIC, ("v2",), tol=0.05, threads=1, out=tmp_path)
    again = rw.load_set(tmp_path / "guaranteed")
    assert again.solutions == "guaranteed" and again.name == "kinematic, guaranteed"
    assert again.volumes() == found.guaranteed.volumes() != found.possible.volumes()
    certified = again.certify(200, threads=1)
    assert certified.wrong == certified.near


def test_wrong_input() -> None:
    with pytest.raises(rw.SetError, match="solutions: unknown 'some'; valid: slowest, possible, guaranteed"):
        rw.feasible_set("two_finger", rw.KINEMATIC, ("v2",), solutions="some")
