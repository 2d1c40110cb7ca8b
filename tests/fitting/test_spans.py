"""Where spans begin and how long they are, and what is said where several sets of values fit alike."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.fitting.found import Alike
from rungwise.fitting.measured.touching import touches, touching
from rungwise.fitting.prepare import Options, Prepared, prepare
from rungwise.fitting.unlike import begins_clear

from .drops import NAMES, SCENE, drops

YIELDING: dict[str, Any] = SCENE | {
    "parameters": SCENE["parameters"] | {"C": {"default": 300.0, "range": [10.0, 3000.0]}},
    "contacts": [{"between": ["square", "table"], "friction": "mu", "stiffness": 1e6, "damping": "C"}],
}


def prepared(motions: rw.Motions, span: float | None = None, rung: rw.Rung = rw.DYNAMIC_RIGID) -> Prepared:
    scene = YIELDING if rung.compliant else SCENE
    return prepare(scene, rung, motions, ("mu",), None, None, Options(span, 10, None, None, 1, 0))


@pytest.mark.parametrize("seed", range(3))
def test_spans_begin_where_nothing_touches(seed: int) -> None:
    one = prepared(drops(12, 60, seed=seed), 0.05)
    spans, closed = one.spans(), touching(one.scene, one.layout, {})
    starts = np.round(spans.first / 0.004).astype(int)
    for trial, start in zip(spans.trial, starts, strict=True):
        near = slice(max(start - 3, 0), start + 4)
        assert not closed[trial][start] or closed[trial][near].all()
    assert (np.diff(spans.first)[np.diff(spans.trial) == 0] > 0.0).all()


@pytest.mark.parametrize("stiffness", [5e4, 2e5])
def test_spans_contain_impacts_that_last_a_few_frames_as_a_whole(stiffness: float) -> None:
    """How far contacts have yielded was not measured: runs that begin there lose it."""
    contact = YIELDING["contacts"][0] | {"stiffness": stiffness}
    motions = drops(
        12, 24, scene=YIELDING | {"contacts": [contact]}, rung="dynamic-compliant", tol=1e-6, C=60.0
    )
    one = prepared(motions, rung=rw.DYNAMIC_COMPLIANT)
    spans, closed = one.spans(), touching(one.scene, one.layout, {})
    starts = np.round(spans.first / 0.004).astype(int)
    within = np.array([closed[trial][start] for trial, start in zip(spans.trial, starts, strict=True)])
    assert within.mean() < 0.04 and len(within) >= 3 * 12
    clear = begins_clear(one.layout, closed, spans, yields=True)
    assert np.array_equal(clear, ~within) and begins_clear(one.layout, closed, spans).all()


def test_a_trial_that_begins_with_an_impact_is_not_begun_after_it() -> None:
    """A single impact, as ellipses were measured: contact at the first frame, and flight after it."""
    places = np.zeros((3, 3, 3))
    places[..., 1] = 0.03 + np.array([0.0, 2e-3, 4e-3])
    spans = prepared(rw.Motions(NAMES, 0.0025 * np.arange(3), places), np.inf).spans()
    assert spans.first.tolist() == [0.0, 0.0, 0.0]


def test_there_are_two_spans_for_each_touch_and_four_at_least() -> None:
    bouncing = np.zeros((1, 81, 3))
    bouncing[0, :, 1] = 0.04 + 0.02 * np.cos(np.arange(81) * np.pi / 8.0) ** 2
    bouncing[0, :, 1] -= bouncing[0, :, 1].min() - 0.03
    one = prepared(rw.Motions(NAMES, 0.01 * np.arange(81), bouncing))
    closed = touching(one.scene, one.layout, {})
    assert touches(closed) == 10.0
    assert one.spans().durations.sum(axis=1).max() == pytest.approx(0.8 / 20.0)
    motions = drops(3, 40)
    for trial in motions.trials:
        trial.q[:, 1] += 1.0
    falling = prepared(motions)
    assert falling.spans().durations.sum(axis=1).max() == pytest.approx(0.04)


def test_steps_are_finer_where_impacts_last_a_few_of_them() -> None:
    rigid, yielding = (prepared(drops(2), rung=each).tol for each in (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT))
    assert rigid is not None and yielding is not None and yielding < 0.1 * rigid


@pytest.mark.long
@pytest.mark.parametrize("damping", [150.0, 300.0, 500.0])
def test_damping_of_impacts_comes_back(damping: float) -> None:
    """Steps of a thousandth of the part damp impacts themselves, and starts within an impact lose what it
    yielded: both made dampings 4 to 7 % too small."""
    motions = drops(12, 40, scene=YIELDING, rung="dynamic-compliant", tol=1e-7, C=damping)
    found = rw.fit(YIELDING, "dynamic-compliant", motions, ("mu", "C"), threads=1)
    low, high = found.intervals["C"]
    assert found.values["C"] == pytest.approx(damping, rel=0.03) and high - low < 0.12 * damping


@pytest.mark.long
def test_sets_of_values_that_fit_alike_are_named_and_are_not_one_answer() -> None:
    found = rw.fit(SCENE, "dynamic-rigid", drops(6), ("mu", "e"), threads=1)
    assert found.ok and not found.alike and "fit alike" not in str(found)
    several = replace(found, alike=(Alike({"mu": 0.1, "e": 0.4}, 0.7), Alike({"mu": 0.2, "e": 0.3}, 0.3)))
    assert not several.ok
    assert "2 sets of values fit alike: mu 0.1, e 0.4 (70%); mu 0.2, e 0.3 (30%)" in str(several)
    assert several.summary()["alike"][1] == {"values": {"mu": 0.2, "e": 0.3}, "share": 0.3}
