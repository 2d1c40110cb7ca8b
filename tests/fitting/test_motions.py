"""Measured motions: what they take, what they refuse, and the velocities that follow from places."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.fitting.measured.layout import turn_between
from rungwise.fitting.measured.smoothing import deviation, smooth

from .drops import NAMES, SCENE, drops

TIMES = np.arange(5) * 0.1
PLACES = np.zeros((2, 5, 3))


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"places": np.zeros((2, 5, 2))}, r"places.0: must have the shape \(k, 3\), not \(5, 2\)"),
        ({"places": np.zeros((2, 2, 3))}, "places.0: has 2 frames, and needs at least 3"),
        ({"places": "x"}, "places.0: must be numbers in an array, not 'x'"),
        ({"times": TIMES[::-1]}, "times.0: must ascend, and do not at frame 1"),
        ({"times": TIMES[:4]}, r"times.0: must have the shape \(5,\), not \(4,\)"),
        ({"times": [TIMES]}, "times: are of 1 trials, and places of 2"),
        ({"velocities": PLACES[:, :4]}, "velocities.0: has 4 frames, and places.0 5"),
        ({"units": {"square.x": "mil"}}, "units.square.x: unknown unit 'mil'"),
        ({"units": {"x": "mm"}}, "units: unknown 'x'"),
        ({"units": {"square.x": "kg"}}, "units.square.x: 'kg' is no unit of a length or an angle"),
        ({"units": {"time": "mm"}}, "units.time: 'mm' is no unit of a time"),
        ({"deviations": {"square.x": 0.0}}, "deviations.square.x: must be a number greater than 0"),
        ({"parameters": {"mu": [0.1, 0.2, 0.3]}}, r"parameters.mu: must be a number or \(2,\), not \(3,\)"),
        ({"inputs": {"u": np.zeros((2, 4))}}, "inputs.u.0: must be 5 finite numbers, one a frame"),
        ({"coordinates": ("square.x", "square.x", "square.y")}, "coordinates: square.x is twice"),
        ({"places": PLACES * np.nan}, "places.0: a column has no number"),
    ],
)
def test_wrong_motions_are_one_line(given: dict[str, Any], line: str) -> None:
    whole = {"coordinates": NAMES, "times": TIMES, "places": PLACES} | given
    with pytest.raises(rw.MotionError, match=line):
        rw.Motions(**whole)


def test_names_that_the_scene_does_not_have_are_refused() -> None:
    motions = rw.Motions(("square.z", "square.y"), TIMES, PLACES[..., :2])
    with pytest.raises(rw.MotionError, match=r"coordinates: unknown 'square.z'"):
        rw.fit(SCENE, "dynamic-rigid", motions, "mu")
    known = rw.Motions(NAMES, TIMES, PLACES, parameters={"mo": 0.1})
    with pytest.raises(rw.MotionError, match="parameters: unknown 'mo'"):
        rw.fit(SCENE, "dynamic-rigid", known, "mu")
    beyond = rw.Motions(NAMES, TIMES, PLACES, parameters={"e": [0.5, 1.5]})
    with pytest.raises(rw.MotionError, match=r"parameters.e: 1.5 in trial 1 is outside 0 to 1"):
        rw.fit(SCENE, "dynamic-rigid", beyond, "mu")
    asked = rw.Motions(NAMES, TIMES, PLACES, parameters={"mu": 0.1})
    with pytest.raises(rw.MotionError, match=r"parameters.mu: is known in the motions"):
        rw.fit(SCENE, "dynamic-rigid", asked, "mu")


@pytest.mark.parametrize(("length", "time"), [("mm", "s"), ("um", "ms"), ("cm", "us"), ("m", "s")])
@pytest.mark.parametrize("measured", ["m", "mm", "nm"])
def test_columns_that_state_a_unit_are_counted_in_the_scenes_units(
    length: str, time: str, measured: str, tmp_path: Path
) -> None:
    """A length of 2, an angle of 30 degrees, a speed of 3 and a slope of 5 degrees, in the scene's units."""
    si = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "s": 1.0, "ms": 1e-3, "us": 1e-6}
    scene = rw.load(
        SCENE | {
            "units": {"length": length, "time": time},
            "parameters": SCENE["parameters"] | {"slope": {"default": 0, "range": [-20, 20], "unit": "deg"}},
        }
    )  # fmt: skip
    ratio = si[length] / si[measured]
    places = np.full((1, 5, 2), [2.0 * ratio, 30.0])
    motions = rw.Motions(
        NAMES[::2], 1e3 * si[time] * TIMES, places, np.full((1, 5, 1), 3.0 * ratio / si[time]),
        rates=("square.x",), parameters={"slope": np.deg2rad(5.0), "mu": 0.3},
        deviations={"square.x": 0.2 * ratio},
        units={
            "time": "ms", "square.x": measured, "square.angle": "deg", "speed(square.x)": f"{measured}/s",
            "slope": "rad", "mu": "1",
        },
    )  # fmt: skip
    motions.save(tmp_path / "with_units.csv")
    again = rw.Motions.from_csv(tmp_path / "with_units.csv")
    for one in (motions.counted_in(scene), again.counted_in(scene)):
        trial = one.trials[0]
        assert trial.times == pytest.approx(TIMES) and trial.q[0] == pytest.approx([2.0, np.pi / 6])
        assert trial.v is not None and trial.v[0] == pytest.approx([3.0])
        assert trial.parameters == pytest.approx({"slope": 5.0, "mu": 0.3})
    assert motions.counted_in(scene).deviations == pytest.approx({"square.x": 0.2})


def test_units_that_are_not_those_of_what_is_measured_are_refused() -> None:
    for motions, line in (
        (rw.Motions(NAMES, TIMES, PLACES, units={"square.angle": "mm"}), "units.square.angle: m, and in the"),
        (
            rw.Motions(NAMES, TIMES, PLACES, parameters={"e": 1.0}, units={"e": "kg*m/s^2"}),
            "units.e: m\\*kg/s",
        ),
    ):
        with pytest.raises(rw.MotionError, match=line):
            rw.fit(SCENE, "dynamic-rigid", motions, "mu")


def test_what_states_a_unit_is_counted_in_metres_seconds_and_radians() -> None:
    motions = rw.Motions(
        NAMES, TIMES * 1e3, np.full((1, 5, 3), 90.0),
        units={"time": "ms", "square.x": "mm", "square.angle": "deg"}, deviations={"square.x": 1.0},
    )  # fmt: skip
    trial = motions.trials[0]
    assert trial.q[0] == pytest.approx([0.09, 90.0, np.pi / 2])
    assert trial.times == pytest.approx(TIMES) and motions.deviations == {"square.x": 1e-3}


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    motions = drops(3, 10)
    motions.trials[1].q[4, 0] = np.nan
    motions.save(tmp_path / "drops.csv")
    again = rw.Motions.from_csv(tmp_path / "drops.csv", deviations=motions.deviations)
    assert again.coordinates == motions.coordinates and again.rates == motions.rates and len(again) == 3
    for one, other in zip(motions.trials, again.trials, strict=True):
        assert np.array_equal(one.q, other.q, equal_nan=True) and np.array_equal(one.times, other.times)


def test_a_table_tells_units_known_parameters_and_inputs(tmp_path: Path) -> None:
    file = tmp_path / "pushes.csv"
    file.write_text("time [ms],part.x [mm],mu,v\n0,0,0.3,1\n10,1,0.3,2\n20,3,0.3,3\n")
    trial = rw.Motions.from_csv(file).trials[0]
    assert trial.parameters == {"mu": 0.3} and trial.inputs["v"].tolist() == [1.0, 2.0, 3.0]
    assert trial.q[:, 0] == pytest.approx([0.0, 1e-3, 3e-3]) and trial.times[-1] == pytest.approx(0.02)
    file.write_text("time,part.x\n0,0\n1,a\n2,0\n")
    with pytest.raises(rw.MotionError, match=r"part.x in row 2 is no number: 'a'"):
        rw.Motions.from_csv(file)
    with pytest.raises(rw.MotionError, match=r"none.csv' is no file"):
        rw.Motions.from_csv(tmp_path / "none.csv")
    with pytest.raises(rw.MotionError, match="cannot be read as a table"):
        rw.Motions.from_csv(tmp_path)


def test_runs_are_motions() -> None:
    state = rw.State.of(rw.load(SCENE), {"square.y": 0.05})
    run = rw.simulate(SCENE, "dynamic-rigid", state=state, duration=0.2, tol=1e-3)
    motions = rw.Motions.from_runs(run)
    assert motions.coordinates == NAMES and motions.trials[0].v is not None
    assert motions.trials[0].q[0] == pytest.approx([0.0, 0.05, 0.0])


def test_trials_are_split_without_a_rest() -> None:
    first, others = drops(5, 5).split(0.6, seed=3)
    assert len(first) == 3 and len(others) == 2
    with pytest.raises(rw.MotionError, match=r"share: 1.0 of 5 trials leaves one part empty"):
        drops(5, 5).split(1.0)


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6])
def test_windows_reach_over_gaps(share: float) -> None:
    """Parabolas with gaps at random frames: values and rates where there is a number, none where not."""
    rng, times = np.random.default_rng(0), np.arange(60) * 0.01
    rates = rng.normal(size=(2, 3))
    columns = rates[0] * times[:, None] + rates[1] * times[:, None] ** 2
    columns[rng.uniform(size=columns.shape) < share] = np.nan
    found = smooth(times, columns, np.arange(60))
    known = np.isfinite(columns)
    assert np.array_equal(np.isfinite(found.rates), known)
    assert found.values[known] == pytest.approx(columns[known])
    assert found.rates[known] == pytest.approx((rates[0] + 2.0 * rates[1] * times[:, None])[known], abs=1e-9)
    assert deviation(found.scatter, 60) == pytest.approx(0.0, abs=1e-12)


def test_rates_of_a_fall_are_exact_and_a_kink_bends_those_beside_it_only() -> None:
    times = np.arange(40) * 0.01
    fall = np.column_stack([1.0 - 4.9 * times**2])
    found = smooth(times, fall, np.arange(40))
    assert found.rates[:, 0] == pytest.approx(-9.8 * times, abs=1e-9) and found.scatter.max() < 1e-12
    kinked = np.abs(times - 0.2)[:, None]
    rates = smooth(times, kinked, np.arange(40)).rates[:, 0]
    assert rates[:20] == pytest.approx(-1.0) and rates[21:] == pytest.approx(1.0)


def test_rates_at_the_ends_of_windows_are_as_uncertain_as_they_scatter() -> None:
    rng, times = np.random.default_rng(0), np.arange(9) * 0.01
    found = smooth(times, rng.normal(size=(9, 20_000)), np.array([0, 4, 8]))
    scatter = np.sqrt((found.rates**2).mean(axis=1))
    assert scatter == pytest.approx(np.sqrt((found.gain**2).mean(axis=1)), rel=0.1)
    assert found.gain[0].max() == pytest.approx(0.681 / 0.01, rel=0.01)
    assert np.median(found.gain[1]) == pytest.approx(0.189 / 0.01, rel=0.01)


def test_scatter_is_the_deviation_of_the_noise() -> None:
    rng, times = np.random.default_rng(0), np.arange(2000) * 0.01
    found = smooth(times, rng.normal(size=(2000, 1)) * 0.3, np.arange(3, 2000, 7))
    assert deviation(found.scatter, 2000) == pytest.approx(0.3, rel=0.15)


def test_turns_between_quaternions_are_vectors_about_the_body() -> None:
    half = 0.3
    a, b = np.array([1.0, 0.0, 0.0, 0.0]), np.array([np.cos(half), 0.0, np.sin(half), 0.0])
    assert turn_between(a, b) == pytest.approx([0.0, 0.6, 0.0])
    assert turn_between(a, -b) == pytest.approx([0.0, 0.6, 0.0])
    assert turn_between(b, a) == pytest.approx([0.0, -0.6, 0.0])
    assert turn_between(b, b) == pytest.approx(np.zeros(3))
