"""Numbers that runs turn at, from both sides."""

from __future__ import annotations

from inspect import unwrap
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.step import NO_SPANS
from rungwise.outcome import Code
from rungwise.simulation.core.crawl import lead_nowhere
from rungwise.simulation.core.update_state import take_slots
from rungwise.simulation.planar.step import error_control
from rungwise.simulation.spatial import begin, replay
from rungwise.simulation.spatial.replay import _between
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.simulation.threads import Workers
from rungwise.system.planar.contact_manifold import are_parallel
from tests.simulation.core.test_particle import Particle


def test_steps_lead_nowhere_after_so_many_attempts() -> None:
    for span, few, many in ((0.0, 3_000, 30_000), (0.5, 20_000, 200_000)):
        for attempts, ends in ((few, False), (many, True)):
            assert lead_nowhere(attempts, span, 1.0) == ends


@pytest.mark.parametrize(("speed", "bounces"), [(0.003, False), (0.3, True)])
def test_an_approach_as_slow_as_loads_cause_is_rest(speed: float, bounces: bool) -> None:
    """Loads cause g h = 0.01 in a step."""
    falling = Particle((0.0, 0.0), (0.0, -speed), load=(0.0, -10.0), restitution=0.5)
    stepper = Stepper(falling, rw.DYNAMIC_RIGID, 1e-3)
    stepper.advance(1e-3)
    assert (stepper.v[1] > 0.5 * 0.5 * speed) == bounces


def test_steps_grow_and_shrink_by_no_more_than_is_usual() -> None:
    """Where the error is next to nothing, a step twice as long follows; where it is great, a fifth."""
    stepper = Stepper(Particle((0.0, 9.0), load=(0.0, -10.0)), rw.DYNAMIC_RIGID, 1.0)
    assert stepper.advance(1e-6, 1e-6) == pytest.approx(2e-6)
    stepper.advance(0.04, 1e-6)  # 4e-4 is as long as a step may be
    assert stepper.attempts == 1 + 4


def test_what_slides_in_one_judge_alone_is_told_from_a_millionth_of_the_fastest_on() -> None:
    mine: dict[str, float] = {"mode": 1, "gap": 0.0}
    for slip, lines in ((1e-7, 0), (1e-5, 1)):
        assert len(_between("a|b", mine, {"slip": slip, "depth": 0.0}, 1.0)) == lines


@pytest.mark.parametrize(("open_by", "begins"), [(2e-3, True), (5e-2, False)])
def test_joints_of_a_start_may_be_open_by_a_hundredth(
    open_by: float, begins: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    space: Any = SimpleNamespace(
        overlaps=lambda _: [], violations=lambda _: [(open_by, 0, 0)], size=SimpleNamespace(length=1.0)
    )
    monkeypatch.setattr(begin, "_told", lambda *_: "open")
    scene: Any = SimpleNamespace(file=SimpleNamespace(start=SimpleNamespace(settle=False)))
    assert (begin.misplaced(scene, space, np.zeros(1), [], "start") == "") == begins


def test_faces_are_parallel_within_a_tenth_of_a_radian() -> None:
    for tilt, parallel in ((0.03, True), (0.3, False)):
        outline = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(tilt), -np.cos(tilt)]])
        assert are_parallel(0, 1, outline) == parallel


def discs(overlap: float) -> dict[str, Any]:
    """Two discs of radius 1 that overlap, of which one may slide off."""
    disc = {"kind": "disc", "radius": 1.0}
    return {
        "name": "discs",
        "bodies": {
            "one": {"role": "obstacle", "shape": disc},
            "other": {
                "role": "object", "mass": 1.0, "shape": disc, "pose": {"x": 2.0 - overlap},
                "motion": {"kind": "slide", "axis": [1, 0]},
            },
        },
        "contacts": [{"between": ["one", "other"], "stiffness": 1e4, "damping": 1.0}],
        "duration": 2e-3,
        "step": 1e-3,
    }  # fmt: skip


@pytest.mark.parametrize(("overlap", "begins"), [(2e-10, True), (2e-8, False)])
def test_a_start_may_overlap_by_rounding(overlap: float, begins: bool) -> None:
    assert (rw.simulate(discs(overlap), "dynamic-rigid").outcome.name != "invalid") == begins


def test_a_step_to_a_contact_ends_a_little_short_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """By far more than rounding, and by far less than errors that are allowed."""
    for name, value in (("widen", None), ("gather", 1), ("fastest_pair", 0.0)):
        monkeypatch.setattr(error_control, name, lambda *_, value=value: value)
    for gap, rate in ((0.2, -10.0), (3e-6, -1e-4)):
        clock = SimpleNamespace(meets=-1)
        state = SimpleNamespace(
            v=np.array([rate]), speed=np.zeros(1), prescribed=np.zeros(1, bool), modes=np.zeros(1),
            clock=[clock],
        )  # fmt: skip
        terms = SimpleNamespace(
            entries=SimpleNamespace(rows=NO_SPANS),
            rows=np.ones((2, 1)),
            gap=np.array([gap]),
            rounding=np.zeros(1),
        )
        scratch = SimpleNamespace(slots=np.zeros(1, np.int64))
        workspace: Any = SimpleNamespace(state=state, terms=terms, scratch=scratch)
        rung = [SimpleNamespace(compliant=False, inertia=1.0)]
        h, _ = unwrap(error_control.until_contact)(None, rung, workspace, 1.0, 0.0, 0.0, 1e-3, 1.0)
        assert 1e-10 < (gap + rate * h) / gap < 1e-8


@pytest.mark.parametrize("duration", [0.3, 20.0])
def test_steps_of_controlled_length_see_what_lasts_a_tenth_of_a_run(duration: float) -> None:
    """Of a robot at a steady speed, whose steps have no error; and there are no more than that takes."""
    robot = {
        "role": "robot", "shape": {"kind": "disc", "radius": 1.0},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "p"},
        "coordinates": {"p": {"drive": {"kind": "speed", "speed": 1.0}}},
    }  # fmt: skip
    scene = rw.load({"name": "steady", "bodies": {"one": robot}, "duration": duration, "step": 1e-3})
    for rung in (rw.KINEMATIC, rw.DYNAMIC_RIGID):
        times = rw.simulate(scene, rung, tol=1e-3).trajectory.time.values
        assert np.diff(times).max() < 0.15 * duration and len(times) < 40


@pytest.mark.parametrize(("apart", "parts"), [(2e-3, False), (0.05, True)])
def test_motions_part_from_a_hundredth_of_the_scene_on(
    apart: float, parts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    course = SimpleNamespace(settings="", bound=SimpleNamespace(named=None), end=lambda: None)
    monkeypatch.setattr(replay, "_Course", lambda *_: course)
    states = [SimpleNamespace(q=None)] * 3
    monkeypatch.setattr(replay, "_followed", lambda *_: (states, "timeout", ""))
    monkeypatch.setattr(replay, "_apart", lambda *_: np.array([0.0, apart]))
    monkeypatch.setattr(replay, "_reasons", lambda *_: [])
    monkeypatch.setattr(replay, "titles", lambda _: [])
    run: Any = object.__new__(SpaceRun)
    for name, value in (
        ("frames", [SimpleNamespace(time=float(k), q=None) for k in range(3)]),
        ("space", SimpleNamespace(model=SimpleNamespace(stat=SimpleNamespace(extent=1.0)))),
        ("scene", SimpleNamespace(labels=SimpleNamespace(bodies=("floor", "box")))),
    ):
        object.__setattr__(run, name, value)
    found = replay.replay(run)
    assert (found.parts == 0.0) == parts and found.body == ("box" if parts else "")


def test_runs_of_half_a_million_steps_come_to_their_end() -> None:
    """On threads, without a budget of their own; a longer one has not converged."""
    robot = {
        "role": "robot", "shape": {"kind": "disc", "radius": 1.0}, "motion": {"kind": "slide", "axis": [1, 0]}
    }  # fmt: skip
    fields = {"name": "long", "parameters": {"v": {"default": 1.0}}, "bodies": {"one": robot}}
    scene = rw.load(fields | {"goal": "one.s > 9", "duration": 0.5, "step": 2e-6})
    for steps, ends in ((250_000, True), (4_000_000, False)):
        own = Workers(scene, rw.KINEMATIC, ("v",), None, threads=1, step=0.5 / steps)
        found = own.run(np.ones((1, 1)))
        assert (found.results["outcome"][0] != Code.NOT_CONVERGED) == ends


def test_derivatives_by_parameters_keep_nine_digits() -> None:
    """Of gravity that is a sine: changes a hundred times as great see its curvature, or as small rounding."""
    body = {"role": "object", "shape": {"kind": "disc", "radius": 1.0}, "mass": 1.0}
    slides = {"motion": {"kind": "slide", "axis": [1, 0]}}
    falls = {"name": "falls", "parameters": {"a": {"default": 1.0}}, "gravity": ["sin(a)", 0], "step": 0.1}
    scene = rw.load(falls | {"bodies": {"one": body | slides}})
    found = rw.step_sensitivity(scene, rw.DYNAMIC_RIGID, None, [0.0], [1.0], 0.1, wrt=("parameters",))
    assert found.dv["parameters"][0, 0] == pytest.approx(0.1 * np.cos(1.0), rel=1e-9, abs=0.0)


@pytest.mark.parametrize(
    ("fresh", "compliant", "gap", "left"),
    [
        (0, True, -0.2, (0.3, 0.3)), (1, False, -0.2, (0.0, 0.0)), (1, True, 0.2, (0.0, 0.0)),
        (1, True, -0.2, (0.2, 0.0)),
    ],
)  # fmt: skip
def test_contacts_of_new_features_are_deformed_by_what_bodies_overlap(
    fresh: int, compliant: bool, gap: float, left: tuple[float, float]
) -> None:
    state: Any = SimpleNamespace(
        modes=np.ones(1, np.int64), force=np.full((1, 2), 5.0), deformation=np.full((1, 2), 0.3)
    )
    terms: Any = SimpleNamespace(
        deformation=np.zeros(2),
        gap=np.array([gap]),
        contact_stiffness=np.full((1, 2, 2), 1e3),
        skew=np.zeros((0, 3)),
    )
    scratch: Any = SimpleNamespace(slots=np.zeros(1, np.int64))
    unwrap(take_slots)(np.zeros(1, np.int64), np.array([fresh]), compliant, state, terms, scratch)
    assert terms.deformation.tolist() == list(left)
    assert (state.force == (0.0 if fresh else 5.0)).all()
