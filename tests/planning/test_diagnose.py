"""The diagnosis names the ingredient that was changed, and nothing where nothing matters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.diagnosis import deferred
from rungwise.planning.diagnosis.diagnose import NOTHING, diagnosed, differing
from rungwise.planning.plan import plan_of
from rungwise.world.planar.variant import PlanarVariant as World

PUSH = rw.load("push")
SLOW, FAST = {"v": 0.01}, {"v": 0.6}
STIFF = {"stiffness": 1e7, "damping": 6e3}
Q, D, C = "quasistatic-rigid", "dynamic-rigid", "dynamic-compliant"
CASES = {
    "friction": (SLOW | {"mu": 0.02, "offset": 0.03}, {"mu": 0.6}, Q, C),
    "support": (FAST, {"mu_s": 0.1}, D, D),
    "compliance": (SLOW | {"stiffness": 400.0, "damping": 1.0}, {}, Q, C),
    "inertia": (FAST, {}, Q, C),
    "restitution": (FAST, {"restitution": 0.7}, D, D),
    NOTHING: (SLOW, {}, Q, C),
}


def push(speed: float) -> list[rw.Segment]:
    return [rw.Segment({"ux": 1.0}, 0.1 / speed), rw.Segment({"ux": 0.0}, max(1.0, 0.1 / speed))]


@pytest.mark.few(3)
@pytest.mark.parametrize("cause", CASES)
def test_cause_is_the_ingredient_that_was_changed(cause: str) -> None:
    own, change, before, after = CASES[cause]
    first = STIFF | {"offset": 0.02, "mu": 0.2} | own
    found = rw.diagnose(
        PUSH, before, after, inputs=push(first["v"]), parameters=first, other_parameters=first | change
    )
    assert found.cause == cause
    assert (cause in str(found)) and found.body == "box"
    assert (found.distance > 1e-3) == (cause != NOTHING)


def test_mixed_cause_names_both() -> None:
    first = STIFF | FAST | {"offset": 0.02, "mu": 0.2}
    found = rw.diagnose(
        PUSH, D, D, inputs=push(0.6), parameters=first,
        other_parameters=first | {"mu_s": 0.1, "restitution": 0.8},
    )  # fmt: skip
    assert set(found.causes) == {"support", "restitution"}
    assert set(found.left) == {"support", "restitution"}


def test_coarse_steps_are_a_cause() -> None:
    fast = FAST | {"restitution": 0.8, "offset": 0.02}
    found = rw.diagnose(PUSH, D, D, inputs=push(0.6), parameters=fast, tol=3e-3, other_tol=1e-6)
    assert found.causes == ("accuracy",)
    assert "@" in found.before


def test_changing_all_ingredients_gives_the_other_world() -> None:
    """The hybrid of no ingredient is the first world, of all ingredients the second: same motion, to the bit
    but for the names of rungs."""
    one = World(PUSH, PUSH.parameters({"mu": 0.1}), rw.QUASISTATIC_RIGID, 1e-5)
    other = World(PUSH, PUSH.parameters({"mu": 0.5, "mass": 2.0}), rw.DYNAMIC_COMPLIANT, 1e-5)
    names = differing(one, other)
    assert set(names) == {"friction", "support", "compliance", "inertia", "other numbers"}
    for taken, world in ((frozenset[str](), one), (frozenset(names), other)):
        hybrid = one.mixed(other, taken)
        runs = [
            rw.simulate(each.scene, each.model, parameters=each.parameters, inputs=push(0.02), tol=1e-5)
            for each in (
                hybrid,
                World(world.mixed(world, frozenset()).scene, world.parameters, world.model, 1e-5),
            )
        ]
        assert np.allclose(runs[0].state.q, runs[1].state.q, atol=1e-9)


def test_kinematic_rung_differs_in_how_it_chooses_motions() -> None:
    found = rw.diagnose(PUSH, "kinematic", Q, inputs=push(0.02), parameters={"offset": 0.02})
    assert "balance" in found.causes
    assert "another motion was admissible" in str(found)


@pytest.mark.few(2)
@pytest.mark.parametrize("after", ["kinematic", Q, D])
def test_what_snaps_because_contacts_yield_jams_without(after: str) -> None:
    """Also against the kinematic rung, which differs in all else, too."""
    found = rw.diagnose("snap", "quasistatic-compliant", after)
    assert found.causes == ("compliance",) and found.body == "clip" and found.outcome == "jammed"
    assert found.ends[1]["certificate"]["contacts"] == ["clip|lower", "clip|upper", "rod|clip"]
    assert max(found.details["compliance"]["overlap"]) == pytest.approx(2e-4, rel=0.02)


def test_stages_on_which_nothing_is_found_are_diagnosed(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the first plan of a later stage, once, when it is asked for; files keep what comes of it."""
    made = list[str]()

    def counted(*given: Any, **named: Any) -> rw.Diagnosis:
        made.append(str(given[2]))
        return diagnosed(*given, **named)

    monkeypatch.setattr(deferred, "diagnosed", counted)
    stages = [(name, 1e-2) for name in ("kinematic", Q, "quasistatic-compliant", C)]
    plan = rw.plan("snap", schedule=stages, budget=30_000)
    assert not made
    assert plan_of(plan.text()).diagnosis == plan.diagnosis and len(made) == 2
    assert [record.how for record in plan.records] == ["nothing found", "nothing found", "planned", "held"]
    assert plan.found and [found.after for found in plan.diagnosis] == ["kinematic @ 0.01", f"{Q} @ 0.01"]
    for found in plan.diagnosis:
        assert found.before == "quasistatic-compliant @ 0.01" and found.cause == "compliance"
        assert found.outcome == "jammed"
