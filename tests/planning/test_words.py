"""Every cause is said in words and in numbers, and ends are said with their certificates."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.diagnosis.diagnose import APART, NOTHING, table
from rungwise.planning.diagnosis.sentences import UNTOUCHED, WORDS, Told, sentence
from rungwise.world.ingredients import INGREDIENTS

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import diagnosis as cases

SAID = {
    "friction": r"rod\|box (slid|stuck|was open) ",
    "support": "friction with the support of box differs: ",
    "compliance": r"bodies sank into each other on dynamic-compliant: rod\|box by \d.*cannot on quasistatic",
    "inertia": r"box (coasted \d.* on its momentum|had momentum).* \(kinetic energy at most \d",
    "restitution": r"bounced after an impact in the second: rod\|box (met at \d.* and )?separated at \d",
}


def drawn(kind: str, seed: int) -> rw.Diagnosis:
    """The first case of the benchmark that is no near miss."""
    rng = np.random.default_rng(seed)
    while True:
        change = cases.KINDS[kind](rng)
        found = cases.diagnosis(change)
        if kind == "null" or found.distance >= 2.0 * APART * cases.size(change[1]):
            return found


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", SAID)
def test_cause_is_said_with_its_numbers(kind: str) -> None:
    found = drawn(kind, 1)
    assert found.causes == (kind,) and set(found.details) == {kind}
    (said,) = found.reasons
    assert said.startswith(f"{kind}: ")
    assert re.search(SAID[kind], said), said
    assert rw.Diagnosis.of(json.loads(json.dumps(found.summary()))) == found


def test_mixed_causes_have_a_sentence_each_and_no_difference_none() -> None:
    found = drawn("mixed", 1)
    assert len(found.reasons) == len(found.causes)
    none = drawn("null", 1)
    assert none.cause == NOTHING and NOTHING in str(none) and none.reasons == []


def test_what_a_coasting_body_does_is_measured() -> None:
    """A box that is let go at v slides v^2 / (2 mu_s g), with the energy m v^2 / 2."""
    fast = {"v": 0.5, "offset": 0.0, "near": 0.0, "goal_x": 9.0}
    inputs = [rw.Segment({"ux": 1.0}, 0.2), rw.Segment({"ux": 0.0}, 1.0)]
    found = rw.diagnose(rw.load("push"), "quasistatic-rigid", "dynamic-rigid", inputs=inputs,
                        parameters=fast)  # fmt: skip
    detail = found.details["inertia"]
    assert detail["energy"] == pytest.approx([0.0, 0.125], abs=1e-6)
    assert detail["coasted"] == pytest.approx([0.0, 0.25 / (2.0 * 0.35 * 9.81)], rel=0.02, abs=1e-9)


def test_balance_accuracy_and_other_numbers_are_said() -> None:
    push = rw.load("push")
    slides = rw.diagnose(push, "kinematic", "quasistatic-rigid", inputs=[rw.Segment({"ux": 1.0}, 5.0)])
    assert "another motion was admissible: box moves at " in str(slides)
    heavy = rw.diagnose(
        push, "dynamic-rigid", "dynamic-rigid", inputs=[rw.Segment({"ux": 1.0}, 5.0)],
        other_parameters={"width": 0.12},
    )  # fmt: skip
    assert "other numbers: bodies, places or drives differ: width 0.1 -> 0.12" in str(heavy)
    assert "steps were too coarse: errors of 0.01 per step on a @ 1, of 0.001 on a @ 2" in sentence(
        "accuracy", Told({"tol": [0.01, 0.001]}, ("on a @ 1", "on a @ 2"), "box")
    )


def test_jam_is_said_with_the_contacts_of_its_certificate() -> None:
    wedge = {"mu": 1.5, "x": 0.1, "v2": 0.6, "angle": 0.1, "y": 0.1}
    found = rw.diagnose(rw.load("four_finger"), "kinematic", "quasistatic-rigid", parameters=wedge)
    assert found.outcome == "jammed" and "certificate" not in found.ends[0]
    proof = found.ends[1]["certificate"]
    assert proof["kind"] == "frictional" and proof["contacts"] == ["left|part", "part|fixed_left"]
    assert proof["bodies"] == ["fixed_left", "left", "part"]
    assert "jammed: no motion satisfies these contacts together: left|part, part|fixed_left" in str(found)


def test_missing_support_is_said_with_what_gives_way() -> None:
    ball = {
        "name": "ball", "gravity": [0, -9.81], "tolerance": 1e-6, "duration": 1, "step": 1e-3,
        "bodies": {
            "ball": {"role": "object", "mass": 1, "shape": {"kind": "disc", "radius": 0.1},
                     "pose": {"y": 0.5}, "motion": {"kind": "free"}},
            "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
        },
        "contacts": [{"between": ["ball", "floor"], "restitution": 0.5}],
    }  # fmt: skip
    found = rw.diagnose(rw.load(ball), "quasistatic-rigid", "dynamic-rigid")
    assert found.ends[0]["certificate"]["coordinates"] == ["ball.y"]
    assert "unsupported: nothing balances the loads along ball.y" in str(found)
    assert found.details["restitution"]["left"] == pytest.approx(0.5 * np.sqrt(2 * 9.81 * 0.4), rel=0.02)


def test_every_ingredient_has_words_and_new_causes_may_come() -> None:
    assert set(WORDS) == {*INGREDIENTS, UNTOUCHED}
    assert sentence(UNTOUCHED, Told({}, ("on a", "on b"), "box")) == WORDS[UNTOUCHED]


def test_table_is_readable_at_100_columns() -> None:
    found = drawn("mixed", 1)
    lines = table([found])
    assert all(len(line) <= 98 for line in lines) and len(lines) >= 2 + len(found.causes)
    assert f"{found.time:.4g}" in lines[1] and "box" in lines[1] and found.outcome in lines[1]


def test_scene_that_is_impossible_is_one_line() -> None:
    with pytest.raises(rw.SceneError, match="overlaps"):
        rw.diagnose(
            rw.load("push"), "kinematic", "quasistatic-rigid", parameters={"post1_x": 0, "post1_y": 0}
        )
