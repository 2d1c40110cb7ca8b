"""Runs of a fit: points that are asked for again, and starts that are moved where parameters move bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting import predict
from rungwise.fitting.predict import Predictor
from rungwise.fitting.prepare import Options, prepare

from .drops import SCENE, drops

RAISED: dict[str, Any] = SCENE | {
    "parameters": SCENE["parameters"] | {"height": {"default": 0.0, "range": [-0.01, 0.01]}},
    "bodies": SCENE["bodies"] | {"table": SCENE["bodies"]["table"] | {"pose": {"y": "height"}}},
}


def predictor(*over: str, known: bool = False) -> Predictor:
    motions = drops(3)
    if known:
        places = np.array([trial.q for trial in motions.trials])
        own = {"height": np.array([-2e-3, 0.0, 2e-3])}
        motions = rw.Motions(motions.coordinates, motions.trials[0].times, places, parameters=own)
    one = prepare(RAISED, rw.DYNAMIC_RIGID, motions, over, None, None, Options(None, 5, None, None, 1, 0))
    return one.predictor(one.spans(), NEVER)


def test_points_that_are_asked_for_again_take_no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(predict, "KEPT", 4)
    one, points = predictor("mu", "e"), np.random.default_rng(0).uniform(size=(6, 2))
    first = one(points[[0, 1, 0]])
    made = int(one.made[0])
    assert made == 2 * len(one.spans.trial) and np.array_equal(first.errors[0], first.errors[2])
    again = one(points[:3])
    assert int(one.made[0]) == made + len(one.spans.trial)
    assert np.array_equal(again.errors[:2], first.errors[:2])
    one(points[3:])
    assert np.array_equal(one(points[[2, 0]]).errors[1], first.errors[0])
    assert int(one.made[0]) == made + 5 * len(one.spans.trial)
    assert np.array_equal(predictor("mu", "e")(points[:1]).errors[0], first.errors[0])
    assert not np.array_equal(one.at_tol(1e-8)(points[:1]).errors[0], first.errors[0])


@pytest.mark.parametrize(("over", "known"), [(("mu", "height"), False), (("mu", "e"), True)])
def test_starts_are_moved_alike_one_by_one_and_together(over: tuple[str, ...], known: bool) -> None:
    one = predictor(*over, known=known)
    points = np.array([[0.2, 8e-3], [0.4, 8e-3], [0.2, 0.0 if known else -8e-3]])
    rng = np.random.default_rng(0)
    shifts = 3e-3 * rng.normal(size=(3, len(one.spans.trial), one.spans.start.shape[1]))
    together = one(points, shifts).errors
    assert np.array_equal(together, np.concatenate([one(points[[i]], shifts[[i]]).errors for i in range(3)]))
    if "height" in over:
        assert one._parting.placing(one.spans.q, {}) == {"height"}
        one(points[:1])
        assert one.moved.max() > 0.0
        one(points[2:])
        assert one.moved.max() == 0.0
