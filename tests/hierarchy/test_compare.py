"""The hierarchy between the models against closed forms: orders, distances, Definition 1, counterexamples."""

from __future__ import annotations

import json
import math
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import rungwise as rw
from rungwise.hierarchy import stages
from rungwise.hierarchy.along_paths import FLOOR, Distances, exponent
from rungwise.hierarchy.inputs import inputs_of
from rungwise.hierarchy.limits import INDEPENDENT, SAME, TENDS, UNDECIDED, Fit, fit
from rungwise.hierarchy.motions import Bench
from rungwise.hierarchy.paths import LIGHT, PROPORTIONAL, RATIO, UNDAMPED, Path
from rungwise.world.find import world_of
from rungwise.world.matching import damping_ratio, restitution
from rungwise.world.planar.matching import matched
from tests.simulation.test_limits import damped

STARTS, ENDS = 1.5, 1.58
"""When finger 1 meets the part at v1 = 1, and a time before finger 2 does."""
EXTENT = 2.0


@pytest.fixture(scope="module")
def pushed() -> rw.Scene:
    """The two-finger scene without conditions, on a palm whose viscous drag on the part is `support`."""
    data = rw.load("two_finger").file.model_dump(mode="json") | {"goal": None, "doomed": None, "task": None}
    data["parameters"]["support"] = {"default": 0.0, "range": [0.0, 1e6]}
    data["bodies"]["part"]["coordinates"]["x3"]["damping"] = "support"
    return rw.load(data)


def compared(scene: rw.Scene, model: str | None = None, **parameters: float) -> rw.Comparison:
    given = {"v2": 0.6, "mu": 0.0, **parameters}
    return rw.compare(scene, model, parameters=given, samples=0, duration=ENDS)


def benched(scene: rw.Scene, **parameters: float) -> Bench:
    values = scene.parameters({"v2": 0.6, "mu": 0.0, **parameters})
    extent, levers = world_of(scene).measures(values, ENDS)
    return Bench(matched(scene, values, ENDS), inputs_of(scene, values), ENDS, extent, levers, None)


def fits(found: rw.Comparison, richer: rw.Rung, simpler: rw.Rung) -> tuple[Fit, ...]:
    return next(
        each.fits for each in found.pairs if (each.pair.richer, each.pair.simpler) == (richer, simpler)
    )


def of(found: rw.Comparison, richer: rw.Rung, simpler: rw.Rung) -> Any:
    return next(each for each in found.pairs if (each.pair.richer, each.pair.simpler) == (richer, simpler))


def test_restitution_of_a_damping_ratio() -> None:
    assert restitution(0.0) == 1.0 and restitution(1.0) == pytest.approx(math.exp(-2.0))
    assert restitution(1.0 - 1e-9) == pytest.approx(restitution(1.0 + 1e-9), rel=1e-6)
    for bounce in (1e-3, 0.1, 0.5, 0.99, 1.0):
        assert restitution(damping_ratio(bounce)) == pytest.approx(bounce)
    # The threshold of the two-finger grasp on damped contacts is that of impacts with this restitution.
    assert 1.0 / (1.5 + 0.5 / (1.0 + restitution(1e4 / (2.0 * math.sqrt(2e6))))) == pytest.approx(
        0.50218, abs=2e-5
    )


def test_what_is_matched() -> None:
    scene = rw.load("two_finger")
    for given in ({"damping": 1e3}, {"restitution": 0.4}):
        found = matched(scene, scene.parameters(given), 4.0)
        records = found.scene.bind(found.parameters).records.contacts[0]
        # One face at 45 degrees on a mass of 1 that slides along the palm: a mass of 2 along the normal.
        ratio = records["damping"] / (2.0 * math.sqrt(2.0 * records["stiffness"]))
        assert records["restitution"] == pytest.approx(restitution(float(ratio)))
    push = rw.load("push")
    weighed = matched(push, push.parameters(), 5.0)
    body = weighed.scene.bind(weighed.values(rw.KINEMATIC)).records.bodies[1]
    ratio = float(push.bind().records.supports[0]["ratio"])
    assert body["inertia"] / body["mass"] == pytest.approx(ratio**2)
    body = weighed.scene.bind(weighed.values(rw.DYNAMIC_RIGID)).records.bodies[1]
    assert body["inertia"] / body["mass"] == pytest.approx((0.1**2 + 0.1**2) / 12.0)


def test_order_in_inertia_is_one_on_supports_with_damping() -> None:
    """A finger on a spring, which drags itself and a block through a medium."""
    servo = {"kind": "servo", "stiffness": 4.0, "damping": 0.5, "target": 0.5}
    scene = damped(servo, 10.0, True, duration=0.1)
    found = rw.compare(scene, "dynamic-rigid", samples=0)
    (fit,) = fits(found, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID)
    assert fit.verdict == TENDS, fit
    assert fit.order == pytest.approx(1.0, abs=0.05) and fit.error < 0.05


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("path", "ratio", "order"), [(RATIO, 0.3, 0.5), (UNDAMPED, 0.3, 0.5), (PROPORTIONAL, 3.5, 1.0)]
)
def test_orders_in_stiffness(pushed: rw.Scene, path: Path, ratio: float, order: float) -> None:
    """K^-1/2 at a fixed damping ratio and undamped, 1/K with damping in proportion."""
    bench = benched(pushed, damping=ratio * 2.0 * math.sqrt(2e6))
    own = bench.inputs.own[None]
    found = fit(bench, path, rw.DYNAMIC_COMPLIANT, rw.DYNAMIC_RIGID, own, np.array([ENDS]))
    assert found.verdict == TENDS and not found.why
    assert found.order == pytest.approx(order, abs=0.05 * order) and found.error < 0.05 * order


def test_distance_of_an_undamped_impact(pushed: rw.Scene) -> None:
    """A spring of stiffness K across a face at 45 degrees keeps the part of mass 1 for pi sqrt(2 / K), in
    which it falls behind by v1 times that."""
    found = compared(pushed, "dynamic-compliant", damping=0.0, restitution=1.0)
    (same,) = of(found, rw.DYNAMIC_COMPLIANT, rw.DYNAMIC_RIGID).nearest.same
    error = sum(float(found.errors[name][0]) for name in ("dynamic-compliant", "dynamic-rigid"))
    exact = math.pi * math.sqrt(2.0 / 1e6) / EXTENT
    assert error < 0.05 * exact and same == pytest.approx(exact, abs=error)


def test_frictionless_palm_is_reported_as_the_exception() -> None:
    """Prescribed speeds and nothing that resists: the dynamic run does not depend on M."""
    found = rw.compare("two_finger", "dynamic-rigid", parameters={"v2": 0.7, "restitution": 0.5}, samples=0)
    pair = of(found, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID)
    assert pair.fits[0].verdict == INDEPENDENT and pair.verdict == "fails" and not found.ok
    example = next(each for each in found.counterexamples if "dynamic-rigid -> quasistatic" in each.words)
    fast, slow = example.replay()
    assert fast.model.inertia == pytest.approx(1e-5)
    times = np.linspace(0.5, 1.0, 31)[1:] * example.richer.duration
    places = [
        np.interp(times, run.trajectory.time, run.trajectory.position.sel(coordinate="part.x3"))
        for run in (fast, slow)
    ]
    away = np.abs(places[1] - places[0]).max() / EXTENT
    assert away == pytest.approx(example.distance, rel=0.02)


def test_distance_of_a_bounce_from_the_slowest_motion(pushed: rw.Scene) -> None:
    """The part goes ahead of the finger at (1 + e) v1, and at v1 in the slowest motion."""
    bounce = 0.5
    found = compared(pushed, "quasistatic-rigid", restitution=bounce)
    same = of(found, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID).nearest.same
    assert same == pytest.approx([bounce * (ENDS - STARTS) / EXTENT], rel=2e-3)
    assert of(found, rw.QUASISTATIC_RIGID, rw.KINEMATIC).nearest.same == pytest.approx([0.0], abs=1e-9)


def test_definition_1_where_nothing_can_follow(pushed: rw.Scene) -> None:
    """At mu >= 1 fingers stick: no input of the quasistatic rung moves the part, that of the kinematic rung
    moves by v1 (t - 1.5)."""
    found = compared(pushed, "kinematic", mu=2.0)
    pair = of(found, rw.QUASISTATIC_RIGID, rw.KINEMATIC)
    assert pair.verdict == "fails" and not found.ok
    assert pair.nearest.value == pytest.approx((ENDS - STARTS) / EXTENT, rel=1e-4)
    (example,) = found.counterexamples
    stuck, moved = example.replay()
    assert stuck.final["part"]["x3"] == pytest.approx(0.0, abs=1e-6)
    assert moved.final["part"]["x3"] == pytest.approx(ENDS - STARTS, rel=1e-3)


def test_definition_1_where_another_input_comes_nearest() -> None:
    """A force pulls a mass through a medium: x = u/d t without inertia, u/d (t - tau (1 - exp(-t/tau))) with
    it. The constant u that stays nearest to a given v is that of a search in one number."""
    mass, drag = 0.1, 1.0
    slider = {
        "role": "robot",
        "mass": mass,
        "shape": {"kind": "disc", "radius": 1.0},
        "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"damping": drag, "drive": {"kind": "force", "force": "pull"}}},
    }
    scene = {"name": "pulled", "bodies": {"slider": slider}, "duration": 1.0, "step": 1e-3}
    scene |= {"parameters": {"pull": {"default": 1.0, "range": [0.0, 10.0]}}}
    found = rw.compare(scene, "dynamic-rigid", samples=5)
    near = of(found, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID).nearest
    times, tau = np.arange(1, 61) / 60.0, mass / drag
    lags = times - tau * (1.0 - np.exp(-times / tau))

    def away(u: float, v: float) -> float:
        return float(np.abs(v * times - u * lags).max()) / drag / found.extent

    pulls = found.samples[:, 0]
    assert near.same == pytest.approx([away(v, v) for v in pulls], rel=1e-2)
    best = [
        minimize_scalar(away, bounds=(0.5, 1.5), args=(v,), options={"xatol": 1e-9}, method="bounded").fun
        for v in pulls
    ]
    searched = near.least < near.same
    assert searched.sum() >= 3
    for least, exact in zip(near.least[searched], np.array(best)[searched], strict=True):
        assert 0.99 * exact <= least <= 1.05 * exact
    (fit,) = fits(found, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID)
    assert fit.order == pytest.approx(1.0, abs=0.05)


def test_counterexamples_are_files_that_can_be_repeated(pushed: rw.Scene, tmp_path: File) -> None:
    found = compared(pushed, "kinematic", mu=2.0)
    whole, file = found.save(tmp_path / "new")
    told = json.loads(whole.read_text())
    assert told["ok"] is found.ok is False and told["pairs"][0]["verdict"] == "fails"
    example = rw.load_counterexample(file)
    own = found.counterexamples[0]
    assert (example.richer, example.simpler, example.levers) == (own.richer, own.simpler, own.levers)
    assert told["counterexamples"][0]["words"] == example.words == own.words
    assert example.apart(*example.replay()) == pytest.approx(example.distance, rel=1e-3)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"format": "rungwise counterexample 1", "words": 3}'])
def test_files_that_hold_no_counterexample(tmp_path: File, text: str) -> None:
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(rw.InputError, match=r"counterexample: 'x.json' holds no saved counterexample"):
        rw.load_counterexample(tmp_path / "x.json")


def test_scenes_that_have_little() -> None:
    """No inputs, task, contacts, or object; a rung without an answer."""
    slider = {
        "role": "robot", "mass": 1.0, "shape": {"kind": "disc", "radius": 1.0},
        "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1.0}}},
    }  # fmt: skip
    alone = {"name": "alone", "bodies": {"slider": slider}, "duration": 1.0, "step": 1e-2}
    found = rw.compare(alone, "dynamic-rigid", samples=3)
    assert len(found.samples) == 1 and found.ok and not found.counterexamples
    assert all(each.verdict in ("holds", SAME) for each in found.pairs)
    ball = slider | {"role": "object", "motion": {"kind": "free"}, "coordinates": {}}
    falling = alone | {"bodies": {"ball": ball}, "gravity": [0.0, -9.81]}
    found = rw.compare(falling, "dynamic-rigid", samples=0)
    assert set(found.ends["quasistatic-rigid"]) == {"unsupported"}
    pair = of(found, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID)
    assert pair.second == UNDECIDED and "a run ends at 0" in pair.fits[0].why and not found.ok
    assert "unsupported" in str(found)


def test_fits_say_why_they_have_no_order() -> None:
    def walked(distances: list[float], floors: list[float]) -> Fit:
        error = np.array(floors) / FLOOR
        known = Distances(np.zeros((len(error), 1, 1, 1)), np.array(distances), error, error)
        return Fit(LIGHT, known, *known.order(LIGHT.values), 1.0, 0)

    sudden = walked([1e-3, 1e-9, 1e-9, 1e-9, 1e-9], [1e-8] * 5)
    assert sudden.verdict == TENDS and "4 of 5 distances are below 10 times their error" in sudden.why
    rough = walked([1e-3, 1e-3, 1e-3, 1e-3, 1e-3], [1e-2] * 5)
    assert rough.verdict == UNDECIDED and "5 of 5 distances" in str(rough)
    lost = walked([1e-3, math.nan, math.nan, math.nan, math.nan], [1e-5] * 5)
    assert lost.verdict == UNDECIDED and "4 of 5 runs took more than" in lost.why
    bent = walked([1e-3, 1e-5, 1e-3, 1e-5, 1e-4], [1e-8] * 5)
    assert bent.verdict == UNDECIDED and bent.why == "the distances follow no one power"
    assert walked([1e-9] * 5, [1e-8] * 5).verdict == SAME


def test_answer_does_not_depend_on_threads_and_is_short(pushed: rw.Scene) -> None:
    one, two = (
        rw.compare(pushed, "kinematic", samples=3, seed=4, duration=ENDS, threads=threads)
        for threads in (1, 2)
    )
    assert one.summary() == two.summary()
    assert len(repr(one)) < 500 and "from" in str(one) and max(map(len, str(one).splitlines())) <= 110


def test_cheapest_stage(pushed: rw.Scene) -> None:
    """All rungs move alike where the part is pushed slowly against drag, and the bounce is small."""
    found = compared(pushed, "kinematic", support=50.0)
    assert found.cheapest is not None and found.cheapest.distance <= found.accuracy
    enough = [cost for cost in found.costs if cost.distance <= found.accuracy]
    assert found.cheapest.solves == min(cost.solves for cost in enough)


def test_exponent_and_its_error() -> None:
    x = 10.0 ** np.arange(0.0, -4.0, -1.0)
    assert exponent(x, 3.0 * x**0.5) == pytest.approx((0.5, 0.0), abs=1e-12)
    assert all(math.isnan(each) for each in exponent(x[:2], x[:2]))
    y = np.array([0.1, -0.1, -0.1, 0.1])  # no slope over evenly spaced points; residuals of 0.01 each
    slope, error = exponent(x, x * np.exp(y))
    assert slope == pytest.approx(1.0) and error == pytest.approx(
        math.sqrt(0.04 / 2 / (5 * math.log(10) ** 2))
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"model": "geometric"}, "model: the geometric rung"),
        ({"accuracy": 0.0}, "accuracy: must be a number in 1e-6..1"),
        ({"samples": -1}, "samples: must be a whole number"),
        ({"duration": 0.0}, "time: must be a finite number greater than 0"),
        ({"parameters": {"v3": 1.0}}, "parameters: unknown 'v3'"),
    ],
)
def test_wrong_input_is_one_line(options: dict[str, Any], words: str) -> None:
    with pytest.raises(rw.InputError, match=words):
        rw.compare("two_finger", **options)


@pytest.mark.parametrize("moments", [7, 16])
def test_stages_are_judged_at_moments_that_motions_have(
    moments: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many are asked for, also where they do not divide those of the motions."""
    monkeypatch.setattr(stages, "MOMENTS", moments)
    found = rw.compare("two_finger", rw.KINEMATIC, samples=1, threads=1)
    assert found.cheapest is not None
