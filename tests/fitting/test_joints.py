"""Motions of bodies in joints: what was measured nearly holds them, and what was not follows from them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.measured.starts import Parting
from rungwise.fitting.prepare import Options, Prepared, prepare
from rungwise.system.planar import closing
from rungwise.world.find import world_of

OPTIONS = Options(0.2, 5, None, 1e-6, 1, 0)


def chain(links: int, speed: str = "0") -> dict[str, Any]:
    """Links that hang from a wall and swing; the first is driven at a speed."""
    bodies: dict[str, Any] = {"wall": {"role": "obstacle", "shape": {"kind": "point"}}}
    joints: dict[str, Any] = {}
    for k in range(links):
        bodies[f"link{k}"] = {
            "role": "robot", "shape": {"kind": "capsule", "length": 0.2, "radius": 0.01},
            "pose": {"y": -0.1 - 0.2 * k, "angle": "-90 * deg"}, "mass": 0.5, "motion": {"kind": "free"},
        }  # fmt: skip
        joints[f"joint{k}"] = {
            "kind": "hinge", "between": [f"link{k - 1}" if k else "wall", f"link{k}"], "at": [0, -0.2 * k],
            "coordinate": {"damping": "damping"},
        }  # fmt: skip
    if speed != "0":
        joints["joint0"]["coordinate"] = {"drive": {"kind": "speed", "speed": speed}}
    return {
        "name": "chain", "parameters": {"damping": {"default": 0.01, "range": [0.0, 0.1]}},
        "gravity": [0, -9.81], "bodies": bodies, "joints": joints, "duration": 1.0, "step": 1e-3,
    }  # fmt: skip


def measured(scene: dict[str, Any], links: int, noise: float, *, angles_only: bool) -> rw.Motions:
    """A run of a chain that was turned aside, with noise; all places, or as encoders measure."""
    rng, loaded = np.random.default_rng(links), rw.load(scene)
    place, n = world_of(loaded).place(None), 3 * links
    aside = np.tile(loaded.start()[0], (2, 1))
    aside[:, 2::3] += rng.uniform(-0.5, 0.5, (2, links)) * ("t" not in str(scene["joints"]))
    freedom = np.tile([1e3, 1e3, 1e-3], 2 * links)
    q, v = place.closed(aside, np.zeros((2, n)), freedom)
    run = rw.rollout(
        loaded, "dynamic-rigid", np.hstack([q, v]), durations=np.full((2, 30), 0.02), tol=1e-6, threads=1
    )
    places = np.concatenate([q[:, None], run.q], axis=1)
    places += noise * rng.normal(size=places.shape) * np.tile([0.2, 0.2, 1.0], links)
    columns = np.arange(2, n, 3) if angles_only else np.arange(n)
    names = [loaded.template.coordinates[j] for j in columns]
    return rw.Motions(names, 0.02 * np.arange(31), places[..., columns])


def prepared(scene: dict[str, Any], motions: rw.Motions) -> Prepared:
    return prepare(scene, rw.DYNAMIC_RIGID, motions, "damping", None, None, OPTIONS)


@pytest.mark.few(3)
@pytest.mark.parametrize("angles_only", [False, True])
@pytest.mark.parametrize("links", [1, 2, 3])
def test_runs_begin_with_joints_that_hold(links: int, angles_only: bool) -> None:
    scene = chain(links)
    one = prepared(scene, measured(scene, links, 2e-3, angles_only=angles_only))
    found = one.predictor(one.spans(), NEVER)(np.array([[0.01]]))
    assert found.ended.all()
    scale = np.maximum(np.abs(found.errors[0]).max(axis=(0, 1)), 1e-12)
    exact = prepared(scene, measured(scene, links, 0.0, angles_only=angles_only))
    exact_errors = exact.predictor(exact.spans(), NEVER)(np.array([[0.01]])).errors[0]
    assert (np.abs(exact_errors).max(axis=(0, 1)) < 0.2 * scale).all()


@pytest.mark.long
def test_joints_are_closed_by_what_is_known_least() -> None:
    """Angles stay as they are where these alone were measured, and a link follows them."""
    loaded = rw.load(chain(2))
    place, start = world_of(loaded).place(None), loaded.start()[0][None]
    turned = start.copy()
    turned[0, [2, 5]] += [0.3, -0.2]
    speeds = np.array([[0.0, 0.0, 1.0, 0.0, 0.0, -2.0]])
    q, v = place.closed(turned, speeds, np.tile([1e3, 1e3, 1e-3], 4))
    upper, lower = -np.pi / 2 + 0.3, -np.pi / 2 - 0.2
    elbow = 0.2 * np.array([np.cos(upper), np.sin(upper)])
    middle = elbow + 0.1 * np.array([np.cos(lower), np.sin(lower)])
    assert q[0] == pytest.approx([*(elbow / 2), upper, *middle, lower], abs=1e-6)
    swing = 0.2 * np.array([-np.sin(upper), np.cos(upper)]) - 0.2 * np.array([-np.sin(lower), np.cos(lower)])
    assert v[0] == pytest.approx(
        [*(0.1 * np.array([-np.sin(upper), np.cos(upper)])), 1.0, *swing, -2.0], abs=1e-5
    )
    for places, began in ((q[0], True), (turned[0] + 3.0 * (turned - start)[0], False)):
        state = rw.State(loaded.template.coordinates, places, v[0], 0.0)
        run = rw.simulate(loaded, "dynamic-rigid", state=state, duration=0.01)
        assert (str(run.outcome) != "invalid") == began and not any("was moved" in n for n in run.notes)
    state = rw.State(loaded.template.coordinates, turned[0], v[0], 0.0)
    closed = rw.simulate(loaded, "dynamic-rigid", state=state, duration=0.01)
    assert str(closed.outcome) != "invalid" and any("was moved" in note for note in closed.notes)


def test_spans_begin_at_their_time_where_a_drive_follows_it() -> None:
    scene = chain(1, speed="2 * sin(6 * t)")
    one = prepared(scene, measured(scene, 1, 0.0, angles_only=True))
    spans = one.spans()
    assert spans.first.max() > 0.3
    errors = one.predictor(spans, NEVER)(np.array([[0.01]])).errors
    assert np.abs(errors).max() < 2e-3


@pytest.mark.parametrize(("aside", "same"), [(1e-11, True), (1e-7, False)])
def test_joints_that_say_the_same_up_to_rounding_are_one(aside: float, same: bool) -> None:
    found = closing._least(np.array([[1.0, 0.0], [1.0, aside]]), np.ones(2), np.array([1.0, 1.0 + aside]))
    assert found == pytest.approx([1.0, 0.0 if same else 1.0], abs=1e-6)


def test_links_that_are_turned_by_radians_are_joined_again() -> None:
    """Which takes more than two of Newton's steps, and as many as there may be where no place closes them."""
    loaded = rw.load(chain(3))
    place, start = world_of(loaded).place(None), loaded.start()[0][None]
    turned, speeds = start.copy(), np.zeros((1, 9))
    turned[0, [2, 5, 8]] += [1.0, -1.5, 2.0]
    q, _ = place.closed(turned, speeds, np.tile([1.0, 1.0, 1.0], 6))
    again, _ = place.closed(q, speeds, np.tile([1.0, 1.0, 1.0], 6))
    assert (again == q).all()


@pytest.mark.parametrize("links", [1, 3])
def test_what_was_measured_moves_by_a_millionth_of_what_was_not(links: int) -> None:
    """Which leads a joint to where it holds: by the angle, whose lever is a tenth, and by the middle."""
    loaded = rw.load(chain(links))
    parting = Parting(loaded, {}, np.ones(3 * links))
    start, n = loaded.start()[0], 3 * links
    aside = np.concatenate([start, np.zeros(n)])
    aside[[0, 1]] += 0.01  # the middle of the first link, which hangs from a wall
    known = np.tile([0.0, 0.0, 1e-3], 2 * links)
    moved = parting.closed(aside[None], {}, known)[0] - aside
    assert moved[[0, 1]] == pytest.approx(-0.01, rel=1e-3)
    assert 1e-11 < np.abs(moved[2:n:3]).max() < 1e-7
