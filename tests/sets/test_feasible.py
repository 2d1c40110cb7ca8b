"""Feasible sets of the two-finger scene against the closed forms, and what users rely on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.sets.cells.labels import labels
from rungwise.sets.request import box_of

BOX = {"v1": (0.2, 2.2), "v2": (0.2, 2.2), "mu": (0.0, 0.9)}


def grasp(model: rw.Rung, over: tuple[str, ...] = ("v1", "v2"), **options: Any) -> rw.FeasibleSet:
    return rw.feasible_set("two_finger", model, over, **{"box": BOX, "threads": 1, **options})


def worst(found: rw.FeasibleSet, end: float) -> float:
    """Greatest distance of a wrong point from the planes r = end and r = 1 / end, in parts of the box."""
    points = found.random(100_000, 8)
    v1, v2 = points[:, 0], points[:, 1]
    truth = (v2 >= end * v1) & (v1 >= end * v2)
    wrong = (found.labels(points) == rw.Label.FEASIBLE) != truth
    away = np.minimum(np.abs(v2 - end * v1), np.abs(v1 - end * v2)) / 2.0
    return float(np.max(away[wrong], initial=0.0))


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [0.02])
@pytest.mark.parametrize(
    ("model", "parameters", "end"),
    [
        (rw.KINEMATIC, {}, 0.5),
        (rw.QUASISTATIC_RIGID, {}, 0.5),
        (rw.QUASISTATIC_COMPLIANT, {}, 0.5),
        (rw.DYNAMIC_RIGID, {}, 0.5),
        (rw.DYNAMIC_RIGID, {"restitution": 0.5}, 0.6 / 1.1),
        (rw.DYNAMIC_RIGID, {"restitution": 1.0}, 4.0 / 7.0),
    ],
    ids=str,
)
def test_bands(model: rw.Rung, parameters: dict[str, float], end: float, tol: float) -> None:
    found = grasp(model, parameters=parameters, tol=tol)
    assert found.complete and found.hits == 0
    assert worst(found, end) <= tol


@pytest.mark.few(4)
@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5, 0.8, 1.0])
def test_the_first_impact_decides(restitution: float) -> None:
    """r from 1 / (1.5 + 0.5 / (1 + e)) to its inverse."""
    found = grasp(rw.DYNAMIC_RIGID, ("v2",), parameters={"restitution": restitution}, tol=1e-3)
    v2 = np.linspace(0.2, 2.2, 20_001)
    caught = v2[found.labels(v2[:, None]) == rw.Label.FEASIBLE]
    end = 1.0 / (1.5 + 0.5 / (1.0 + restitution))
    assert (caught.min(), caught.max()) == pytest.approx((end, 1.0 / end), abs=1e-3 * 2.0)


def test_bands_in_three_dimensions() -> None:
    found = grasp(rw.QUASISTATIC_RIGID, ("v1", "v2", "mu"), tol=0.02)
    assert worst(found, 0.5) <= 0.02


def test_damped_impacts_tighten_the_band_with_friction() -> None:
    """Exact thresholds at v1 = 1, K = 1e6, C = 1e4: 0.50218, 0.50399, 0.51337 for mu = 0, 0.5, 0.9."""
    found = rw.feasible_set(
        "two_finger", rw.DYNAMIC_COMPLIANT, ("mu", "v2"), box={"mu": (0.0, 0.9), "v2": (0.49, 0.53)},
        tol=0.02, threads=1, accuracy=1e-4,
    )  # fmt: skip
    for mu, end in ((0.001, 0.50218), (0.5, 0.50399), (0.899, 0.51337)):
        ratio = np.linspace(0.495, 0.525, 3001)
        caught = found.labels(np.column_stack([np.full(3001, mu), ratio])) == rw.Label.FEASIBLE
        assert ratio[caught].min() == pytest.approx(end, abs=0.02 * 0.04 + 2e-4)


def test_elastic_lies_inside_plastic() -> None:
    plastic, elastic = (grasp(rw.DYNAMIC_RIGID, parameters={"restitution": e}) for e in (0.0, 1.0))
    found = rw.between(plastic, elastic)
    # The triangle between the lines r = 1/2 and r = 4/7, twice, over the box.
    lost = _wedge(0.5) - _wedge(4.0 / 7.0)
    assert found.gained == 0.0 and found.lost == pytest.approx(lost, abs=0.004)


def _wedge(end: float) -> float:
    """Part of the box between r = end and 1 / end."""
    v = np.linspace(0.2, 2.2, 20001)
    return float(np.mean(np.minimum(v / end, 2.2) - np.maximum(end * v, 0.2)) / 2.0)


def test_force_limited_fingers_capture_everywhere_where_they_stick() -> None:
    found = rw.feasible_set(
        "two_finger_servo", rw.QUASISTATIC_RIGID, ("v1", "v2"), box=BOX, parameters={"mu": 1.1}, threads=1
    )
    assert found.volumes() == {"feasible": 1.0}


@pytest.mark.few(1)
@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=str)
def test_friction_opens_the_whole_quadrant_to_force_limited_fingers(model: rw.Rung) -> None:
    """From mu = 1, the slope of the faces, on. Below it the band is [1/2, 2] where forces balance; impacts of
    fingers that yield change it."""
    tol, low, high = 0.02, 0.8, 1.2
    found = rw.feasible_set(
        "two_finger_servo", model, ("v1", "v2", "mu"), box=BOX | {"mu": (low, high)}, tol=tol, threads=1
    )
    assert found.complete and found.hits == 0
    points = found.random(100_000, 8)
    v1, v2, mu = points.T
    caught = found.labels(points) == rw.Label.FEASIBLE
    assert caught[mu > 1.0 + tol * (high - low)].all()
    outside = (mu < 1.0 - tol * (high - low)) & (np.maximum(v2 / v1, v1 / v2) > 2.0)
    assert np.mean(caught[outside]) < 0.03
    if model is rw.QUASISTATIC_RIGID:
        away = np.minimum(np.abs(v2 - 0.5 * v1), np.abs(v1 - 0.5 * v2)) / 2.0
        wrong = (mu < 1.0 - tol * (high - low)) & (caught != ((v2 >= 0.5 * v1) & (v1 >= 0.5 * v2)))
        assert np.max(away[wrong], initial=0.0) <= tol


def test_free_fingers_capture_the_whole_square_where_prescribed_ones_keep_to_a_band() -> None:
    """Panel (d): plastic impacts, speeds up to twice the root of stiffness over mass."""
    box = {"v1": (0.05, 2.0), "v2": (0.05, 2.0)}
    found = rw.feasible_set("two_finger_free", rw.DYNAMIC_RIGID, ("v1", "v2"), box=box, tol=0.02, threads=1)
    assert found.hits == 0 and found.volumes() == {"feasible": 1.0}
    band = grasp(rw.DYNAMIC_RIGID, box=box, tol=0.02)
    assert band.volumes()["feasible"] < 0.6


def test_free_fingers_capture_far_outside_the_band_of_prescribed_ones() -> None:
    """Panel (d): with plastic impacts all ratios from 1/20 to 3, where prescribed ones end at 1/2 and 2."""
    found = rw.feasible_set(
        "two_finger_free", rw.DYNAMIC_RIGID, ("v2",), box={"v2": (0.05, 3.0)}, tol=0.02, threads=1
    )
    assert found.volumes() == {"feasible": 1.0}


def test_prescribed_fingers_jam_where_they_stick() -> None:
    found = grasp(rw.QUASISTATIC_RIGID, parameters={"mu": 1.1}, tol=0.05)
    assert found.volumes()["jammed"] > 0.9
    assert found.witness(np.array([1.0, 0.5])) is None


def test_sets_that_are_not_intervals() -> None:
    """Two windows of one speed: a carriage must be seen in either of two places after one second."""
    scene = rw.load(
        {
            "name": "plates",
            "parameters": {"v": {"default": 1.0, "range": [0.0, 10.0]}},
            "bodies": {
                "block": {
                    "role": "robot", "shape": {"kind": "point"},
                    "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
                    "coordinates": {"s": {"drive": {"kind": "speed", "speed": "v"}}},
                }
            },
            "goal": "t >= 1 and max(0.07 - abs(block.s - 2.31), 0.11 - abs(block.s - 7.77)) >= 0",
            "duration": 1.5,
            "step": 1e-3,
        }
    )  # fmt: skip
    found = rw.feasible_set(scene, rw.KINEMATIC, ("v",), tol=1e-4, threads=1)
    v = np.linspace(0.0, 10.0, 20001)
    caught = v[found.labels(v[:, None]) == rw.Label.FEASIBLE]
    ends = caught[np.flatnonzero(np.diff(caught, prepend=-1.0, append=11.0) > 0.01)[:-1]]
    # It is seen from 1 s on, until the time is over: the slowest come into sight at 1.5 s.
    assert ends == pytest.approx([2.24 / 1.5, 7.66 / 1.5], abs=2e-3)


def test_a_witness_replays_and_a_certificate_bounds_the_error() -> None:
    found = grasp(rw.DYNAMIC_COMPLIANT, tol=0.02)
    for point in ([1.0, 0.9], [0.7, 1.1], [2.0, 1.5]):
        witness = found.witness(np.array(point))
        assert witness is not None and found.replay(witness).outcome.name == "goal"
    vertices = found.tree.vertices  # beside a corner that reached the goal, it is that corner
    good = vertices.places(vertices.keys[vertices.labels == rw.Label.FEASIBLE])[::7]
    for corner, aside in zip(good, np.random.default_rng(4).uniform(-0.3, 0.3, good.shape), strict=True):
        place = np.clip(corner + aside, 0.0, 1 << found.tree.finest)
        witness = found.witness(found.box[:, 0] + place * found.unit)
        assert witness is not None
        exact = found.box[:, 0] + corner * found.unit
        assert [witness["v1"], witness["v2"]] == pytest.approx(exact.tolist(), abs=1e-12)
    certified = found.certify(1000, 0.05, threads=1)
    assert certified.wrong == certified.near and certified.wrong / 1000 < certified.bound < 0.03
    assert found.certify(1, 0.05, threads=1).bound >= 0.95


def test_labels_speak_of_runs() -> None:
    codes = np.array(
        [rw.Code.GOAL, rw.Code.MISSED, rw.Code.DOOMED, rw.Code.NOT_CONVERGED, rw.Code.MODEL_INVALID]
    )
    assert labels(codes).tolist() == [0, 1, 2, 6, 6]
    found = grasp(rw.KINEMATIC, tol=0.05)
    assert found.classify(np.array([[1.0, 1.0], [2.0, 0.5], [9.0, 1.0]])).tolist() == [
        "feasible",
        "doomed",
        "unknown",
    ]


@pytest.mark.parametrize("tol", [0.04, pytest.param(0.01, marks=pytest.mark.long)])
def test_around_the_boundary_of_a_lower_rung(tmp_path: Path, tol: float) -> None:
    """The same set with fewer runs, whether the boundary moves (damping, restitution) or not."""
    over, box = ("v1", "v2"), BOX | {"v1": (0.02, 2.0), "v2": (0.02, 2.0)}
    cheap = grasp(rw.QUASISTATIC_RIGID, over, box=box, tol=tol)
    for model, parameters in (
        (rw.DYNAMIC_RIGID, {}),
        (rw.DYNAMIC_RIGID, {"restitution": 1.0}),
        (rw.DYNAMIC_COMPLIANT, {"damping": 1e4}),
    ):
        whole = grasp(model, over, box=box, tol=tol, parameters=parameters)
        found = grasp(model, over, box=box, tol=tol, parameters=parameters, near=cheap)
        assert found.evaluations < 0.9 * whole.evaluations
        points = found.random(20_000, 5)
        assert np.mean(found.labels(points) != whole.labels(points)) < 1e-3
    found.save(tmp_path / "found")
    again = rw.load_set(tmp_path / "found")
    assert np.array_equal(again.tree.vertices.borrowed, found.tree.vertices.borrowed)
    borrowed = found.tree.vertices.places(found.tree.vertices.keys[found.tree.vertices.borrowed])
    assert len(borrowed) and found.witness(found.box[:, 0] + borrowed[0] * found.unit) is None
    with pytest.raises(rw.SetError, match=r"near: its tol must be the same, not "):
        grasp(rw.DYNAMIC_RIGID, over, box=box, tol=0.5 * tol, near=cheap)


def test_what_a_lower_rung_does_not_show_is_found_by_probes() -> None:
    """Labels borrowed from a set that is wrong everywhere stand only until a probe contradicts them."""
    box = {"v2": (0.05, 2.0)}
    empty = grasp(rw.QUASISTATIC_RIGID, ("v2",), box=box, parameters={"x3": 0.45, "mu": 3.0}, tol=0.01)
    whole = grasp(rw.DYNAMIC_RIGID, ("v2",), box=box, tol=0.01)
    found = grasp(rw.DYNAMIC_RIGID, ("v2",), box=box, tol=0.01, near=empty)
    points = found.random(5_000, 5)
    assert set(np.unique(empty.labels(points))).isdisjoint({rw.Label.FEASIBLE})
    assert np.array_equal(found.labels(points), whole.labels(points))


def test_threads_do_not_change_a_set() -> None:
    one, three = (grasp(rw.DYNAMIC_RIGID, threads=n, tol=0.02) for n in (1, 3))
    assert one.data.identical(three.data)


@pytest.mark.long
def test_an_interrupted_set_goes_on_where_it_was(tmp_path: Path) -> None:
    whole = grasp(rw.QUASISTATIC_RIGID, ("v1", "v2", "mu"), tol=0.03, out=tmp_path / "whole")
    asked = 0

    def stop(_what: str, done: int, _known: int) -> None:
        nonlocal asked
        if done > asked:
            asked = done + 1500
            raise KeyboardInterrupt

    options = {"tol": 0.03, "out": tmp_path / "parts", "resume": True}
    stops = 0
    while True:
        try:
            parts = grasp(rw.QUASISTATIC_RIGID, ("v1", "v2", "mu"), on_progress=stop, **options)
            break
        except KeyboardInterrupt:
            stops += 1
    assert stops >= 3 and parts.data.identical(whole.data)
    again = rw.load_set(tmp_path / "parts")
    points = whole.random(5000, 3)
    assert (again.labels(points) == whole.labels(points)).all() and again.volumes() == whole.volumes()
    kept = list((tmp_path / "parts" / "batches").iterdir())
    assert all(file.name.endswith(".npz") and not file.name.startswith(".") for file in kept)


def test_a_folder_answers_one_request(tmp_path: Path) -> None:
    grasp(rw.KINEMATIC, tol=0.1, out=tmp_path)
    with pytest.raises(rw.SetError, match="holds a set already"):
        grasp(rw.KINEMATIC, tol=0.1, out=tmp_path)
    with pytest.raises(rw.SetError, match="another request"):
        grasp(rw.DYNAMIC_RIGID, tol=0.1, out=tmp_path, resume=True)
    with pytest.raises(FileNotFoundError, match="no finished set"):
        rw.load_set(tmp_path / "nothing")


def test_boxes() -> None:
    scene = rw.load("two_finger")
    assert box_of(scene, ("v1", "restitution"), {"restitution": (0.1, 0.7)}).tolist() == [
        [1e-6, 2.0],
        [0.1, 0.7],
    ]
    with pytest.raises(rw.SetError, match="x3 needs an interval"):
        box_of(scene, ("x3",))
    with pytest.raises(rw.SetError, match="must be an interval within 0 to 1"):
        box_of(scene, ("restitution",), {"restitution": (0.5, 2.0)})


@pytest.mark.parametrize("scene", ["two_finger", "slope"])
def test_a_budget_below_the_first_cells_is_refused(scene: str) -> None:
    with pytest.raises(rw.SetError, match="budget: is too small"):
        rw.feasible_set(scene, rw.QUASISTATIC_RIGID, ["mu"], budget=3, threads=1)


def test_wrong_input() -> None:
    with pytest.raises(rw.SetError, match="over: 1 to 6 parameters"):
        rw.feasible_set("two_finger", rw.KINEMATIC, ())
    for over in ({"v1": (0, 2)}, "v1", None):
        with pytest.raises(rw.SetError, match=r"over: must be a list of names of parameters, not .*box"):
            rw.feasible_set("two_finger", rw.KINEMATIC, over)  # type: ignore[arg-type]
    with pytest.raises(rw.SetError, match="tol"):
        grasp(rw.KINEMATIC, tol=0.0)
    with pytest.raises(ValueError, match="shape"):
        grasp(rw.KINEMATIC, tol=0.2).classify(np.zeros((2, 3)))
