"""Every public call that can take long keeps a `limit` in seconds; what it gives then says so.

Nothing here waits for a clock: limits are over at the start, or when progress was told so many times.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.step.problem import allocate_problem
from rungwise.deadline import Deadline
from rungwise.hierarchy.counterexample import Side
from rungwise.simulation.any_run import AnyRun

FILES = {
    "dataset", "load", "load_counterexample", "load_doomed_set", "load_plan", "load_run", "load_set",
    "load_state", "read_problem", "from_csv", "from_datasets", "from_runs", "save", "text", "to_csv",
    "to_mesh", "write_fclib", "yaml", "csv", "message", "joint_trajectory", "mjcf",
}  # fmt: skip
"""Read or write what is there."""
NAMES = {
    "add_world", "balance", "bind", "bind_values", "body", "boxes", "called", "changed", "check_begun",
    "checked", "contact", "counted_in",
    "data", "designed", "equals", "goal", "holds_on", "how", "joint", "lcp", "levels", "local", "mlcp",
    "names", "normalise", "numbers", "observe", "of", "of_step", "parameter", "parameters", "potential",
    "record", "restart",
    "schema", "shipped", "shipped_in_space", "start", "summary", "task_numbers", "timetable",
    "with_inertia",
}  # fmt: skip
"""Look up, change or describe a scene, a problem or a result."""
ARRAYS = {
    "apart", "as_good", "between", "classify", "failure", "diameter", "force", "force_closure",
    "form_closure", "gradient", "result", "right_hand_side", "speed",
    "labels", "off", "predicted", "random", "sensitivity", "squeeze_plan", "squeezed", "state",
    "split", "take", "touching", "volumes", "witness",
}  # fmt: skip
"""A few array operations on what is known: time grows with what is given, and nothing is searched."""
PICTURES = {"Design.plot", "LabelledSet.plot", "AnyRun.plot", "Run.plot"}
"""Draw what is known."""
QUICK = FILES | NAMES | ARRAYS

PROBLEM = rw.Problem.lcp(np.eye(2), -np.ones(2))
PUSHES = [rw.Segment({"ux": 1.0}, 0.2)]
MOTIONS = rw.Motions(("part.x3",), np.arange(3.0), np.zeros((1, 3, 1)))
BALL = "ball"
INPUTS = {"v1": (0.5, 1.0), "v2": (0.5, 1.0)}


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Public functions and methods by their names, methods with the class that defines them."""
    for name in rw.__all__:
        value = getattr(rw, name)
        if not inspect.isclass(value):
            if callable(value):
                yield name, value
            continue
        for own, method in inspect.getmembers(value, callable):
            home = next((each for each in value.__mro__ if own in vars(each)), object)
            if (
                not own.startswith("_")
                and home.__module__.startswith("rungwise")
                and not inspect.isclass(method)
            ):
                yield f"{home.__name__}.{own}", method


LIMITED = {name for name, call in public() if "limit" in inspect.signature(call).parameters}


def test_every_public_call_has_a_limit_or_is_quick() -> None:
    open_ = {name for name, _ in public()} - LIMITED - PICTURES
    assert {name for name in open_ if name.split(".")[-1] not in QUICK} == set()
    used = {name.split(".")[-1] for name in open_}
    assert used == QUICK, "names that are no longer there"


@pytest.fixture(scope="module")
def planned() -> rw.Plan:
    found = rw.plan("push", task_seed=4, to="quasistatic-rigid")
    assert found.found
    return found


@pytest.fixture(scope="module")
def verified(planned: rw.Plan) -> rw.Verification:
    return rw.verify(planned, samples=20)


@pytest.fixture(scope="module")
def known() -> rw.FeasibleSet:
    return rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), tol=0.1, threads=1)


@pytest.fixture(scope="module")
def lost() -> rw.DoomedSet:
    return doomed(None)


def doomed(limit: float | None, **options: Any) -> rw.DoomedSet:
    return rw.doomed_set(
        "two_finger", "kinematic", ("x1", "x2", "x3"), INPUTS, box={"x3": (-1.6, 1.6)}, cells=6, threads=1,
        limit=limit, **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def compared() -> rw.Comparison:
    return rw.compare("two_finger", "kinematic", samples=1, threads=1)


Says = Callable[[Any], str]
"""What a result says of what is left undone; empty where nothing is."""


def unfinished(found: Any) -> str:
    return str(found.unfinished)


def running(run: Any) -> str:
    return str(run.reason) if run.outcome == "running" else ""


def all_running(found: Any) -> str:
    return "running" if (found.outcome == rw.Code.RUNNING).all() else ""


def text(found: Any) -> str:
    return str(found)


class Given(NamedTuple):
    """Fixtures by name, and a folder."""

    get: Callable[[str], Any]
    folder: Path


def stepped(run: Any, turn: Callable[[Any], Any]) -> Any:
    """A run after a turn, which takes no step; the next one does."""
    turn(run)
    found = run.result()
    assert found.steps == 0
    run.advance()
    assert run.result().steps > 0
    return found


def led(scene: str) -> AnyRun:
    """A run that is told its inputs, and has no time to follow them; then it has."""
    simulation = rw.Simulation(scene, "kinematic")
    simulation.step(0.1, limit=0)
    found = simulation.result()
    assert found.steps == 0 and simulation.step(0.1).time > 0.0
    return found


def astray(policy: rw.Policy) -> rw.Policy:
    """A policy that has no time for a proposal where the box lies elsewhere."""
    start = rw.State.of(policy.plan.scene, parameters=policy.plan.parameters)
    q = start.q + 0.1 * np.array(["box" in name for name in start.names])
    policy(rw.State(start.names, q, start.v))
    assert policy.status == "lost" and "limit" in policy.reason
    return policy


Call = Callable[[Given], Any]
"""A call without time."""
CALLS: dict[str, tuple[Call, Says]] = {
    "simulate": (lambda _: rw.simulate("two_finger", "kinematic", limit=0), running),
    "Simulation.advance": (
        lambda _: stepped(rw.Simulation(BALL, "kinematic"), lambda run: run.advance(limit=0)), running
    ),
    "Simulation.step": (lambda _: led("two_finger"), running),
    "rollout": (lambda _: rw.rollout("two_finger", "kinematic", limit=0), all_running),
    "Batch.run": (
        lambda _: rw.Batch("two_finger", "kinematic", ["v2"]).run(np.ones((8, 1)), limit=0),
        all_running,
    ),
    "Rolled.run": (lambda _: rw.rollout("two_finger", "kinematic").run(0, limit=0), running),
    "Rolled.reason": (lambda _: rw.rollout(BALL, "kinematic").reason(0, limit=0), text),
    "plan": (lambda _: rw.plan("push", task_seed=4, limit=0), lambda found: found.reason),
    "Plan.replay": (lambda on: on.get("planned").replay(limit=0), running),
    "Plan.joint_trajectory": (lambda on: on.get("planned").joint_trajectory(limit=0), text),
    "Plan.policy": (lambda on: astray(on.get("planned").policy(limit=0)), lambda policy: policy.reason),
    "Plan.mjcf": (lambda on: on.get("planned").mjcf(limit=0), text),
    "Plan.plot": (lambda on: on.get("planned").plot(limit=0), lambda figure: drawn(figure)),
    "plot": (lambda on: rw.plot(on.get("planned"), limit=0), lambda figure: drawn(figure)),
    "to_html": (
        lambda on: rw.to_html(on.get("planned"), limit=0), lambda page: page * ("running" in page)
    ),
    "view": (
        lambda on: rw.view(on.get("planned"), html=on.folder / "run.html", limit=0),
        lambda files: "running" if "running" in files[0].read_text() else "",
    ),
    "verify": (lambda on: rw.verify(on.get("planned"), limit=0), unfinished),
    "Verification.replay": (
        lambda on: on.get("verified").replay(on.get("verified").worst[0], limit=0), running
    ),
    "design": (lambda _: rw.design("two_finger", ("v2",), limit=0), unfinished),
    "diagnose": (
        lambda _: rw.diagnose("push", "dynamic-rigid", "kinematic", inputs=PUSHES, limit=0), unfinished
    ),
    "draw_parting": (
        lambda on: rw.draw_parting(
            rw.diagnose("push", "dynamic-rigid", "kinematic", inputs=PUSHES), rw.load("push"),
            on.folder / "a.svg", limit=0,
        ),
        text,
    ),
    "compare": (lambda _: rw.compare("two_finger", limit=0), unfinished),
    "explain": (lambda _: rw.explain("two_finger", MOTIONS, ("v1",), held_out=MOTIONS, limit=0), text),
    "fit": (lambda _: rw.fit("two_finger", "kinematic", MOTIONS, ("v1",), limit=0), text),
    "Counterexample.replay": (
        lambda _: COUNTER.replay(limit=0),
        lambda runs: running(runs[0]) and running(runs[1]),
    ),
    "feasible_set": (
        lambda _: rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), limit=0),
        lambda found: "" if found.complete else "not complete",
    ),
    "solution_sets": (
        lambda _: rw.solution_sets("two_finger", "kinematic", ("v1", "v2"), limit=0),
        lambda found: "" if found.slowest.complete else "not complete",
    ),
    "FeasibleSet.certify": (
        lambda on: on.get("known").certify(50, limit=0),
        lambda found: "no sample" if (found.samples, found.bound) == (0, 1.0) else "",
    ),
    "FeasibleSet.replay": (lambda on: on.get("known").replay({"v1": 1.0, "v2": 0.7}, limit=0), running),
    "doomed_set": (lambda _: doomed(0.0), unfinished),
    "DoomedSet.beside_rule": (
        lambda on: on.get("lost").beside_rule(50, limit=0),
        lambda parts: "not run" if parts["not run"] == 1.0 else "",
    ),
    "replay": (lambda _: rw.replay(rw.simulate(BALL, "dynamic-rigid"), limit=0), unfinished),
    "run_sensitivity": (lambda _: rw.run_sensitivity("two_finger", "kinematic", steps=3, limit=0), text),
    "step_sensitivity": (
        lambda _: rw.step_sensitivity(
            "two_finger", "kinematic", None, np.zeros(3), np.zeros(3), 1e-3, limit=0
        ),
        text,
    ),
    "solve": (
        lambda _: rw.solve(HARD, limit=0), lambda found: found.reason if found.unfinished else ""
    ),
    "solutions": (lambda _: rw.solutions(PROBLEM, limit=0), lambda found: text(found.undecided)),
    "Sensitivity.forward": (lambda _: LINEAR.forward(limit=0), text),
    "Sensitivity.solved": (lambda _: LINEAR.solved(LINEAR.right_hand_side({}), limit=0), text),
    "extreme_motions": (lambda _: rw.extreme_motions(rw.solutions(PROBLEM), limit=0), text),
    "instances": (lambda _: rw.instances("push", 0, limit=0), text),
    "ask": (lambda _: rw.ask("push", "goal", rw.State.of("push"), limit=0), text),
    "geometry": (lambda _: rw.geometry(BALL, rw.State.of(BALL), limit=0), text),
}  # fmt: skip
_side = Side("kinematic", 0.0, {}, (), 1.0, 1e-3)
STEP = allocate_problem(3, 2, 1)
STEP.H[:] = np.eye(3)
LINEAR = rw.Sensitivity(STEP, STEP.c, STEP.w, STEP.w_s)
COUNTER = rw.Counterexample("two runs", _side, _side, 0.1, False, {}, rw.load("two_finger"))
RAISES = {
    "explain", "fit", "Plan.joint_trajectory", "Plan.mjcf",
    "Sensitivity.forward", "Sensitivity.solved", "ask", "compare", "diagnose", "doomed_set", "draw_parting",
    "extreme_motions", "feasible_set", "geometry", "instances", "run_sensitivity", "solution_sets",
    "step_sensitivity",
}  # fmt: skip
"""Calls that have nothing to return without any time."""
_rng = np.random.default_rng(0)
_A = _rng.normal(size=(300, 300))
HARD = rw.Problem.local(_A + _A.T, _rng.normal(size=300), np.full(100, 0.5))


def drawn(figure: Any) -> str:
    """The words on a figure, if "running" is one of them."""
    words = [each.get_text() for each in figure.findobj() if hasattr(each, "get_text")]
    return next((each for each in words if "running" in each), "")


def test_each_call_with_a_limit_is_tried_without_time() -> None:
    assert set(CALLS) == LIMITED


@pytest.mark.few(1)
@pytest.mark.parametrize("name", CALLS)
def test_a_call_without_time_says_so(name: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    call, says = CALLS[name]
    given = Given(request.getfixturevalue, tmp_path)
    if name in RAISES:
        with pytest.raises(rw.LimitError, match=r"^limit: ") as caught:
            call(given)
        assert "\n" not in str(caught.value)
    else:
        assert says(call(given))


@pytest.mark.parametrize(
    "call",
    [
        lambda limit: rw.plan("push", limit=limit),
        lambda limit: rw.design("two_finger", ("v2",), limit=limit),
        lambda limit: rw.compare("two_finger", limit=limit),
        lambda limit: rw.feasible_set("two_finger", "kinematic", ("v2",), limit=limit),
        lambda limit: rw.view("nowhere", limit=limit),
        lambda limit: rw.plot(rw.simulate("two_finger", "kinematic"), limit=limit),
        lambda limit: rw.Simulation("two_finger", "kinematic").advance(limit=limit),
    ],
)
def test_a_wrong_limit_is_named_first(call: Callable[[Any], Any]) -> None:
    for limit in (-1.0, math.nan, "1"):
        with pytest.raises(rw.InputError, match=r"^limit: must be a number of seconds"):
            call(limit)


class Hand:
    """The time of every limit is over when this was called so many times."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, calls: int) -> None:
        self._left = calls
        monkeypatch.setattr(Deadline, "is_over", property(lambda own: own.ends < math.inf and self._left < 0))
        monkeypatch.setattr(Deadline, "seconds", property(self._seconds))

    def _seconds(self, own: Deadline) -> float | None:
        return None if own.ends == math.inf else 0.0 if self._left < 0 else 1e9

    def __call__(self, *_: object) -> None:
        self._left -= 1


@pytest.mark.few(2)
@pytest.mark.parametrize("parts", [0, 1, 5, 6])
def test_a_comparison_keeps_what_is_measured(
    parts: int, compared: rw.Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    hand = Hand(monkeypatch, parts)
    found = rw.compare("two_finger", "kinematic", samples=1, threads=1, limit=1e9, on_progress=hand)
    assert found.unfinished and found.unfinished in " ".join(str(found).split()) and not found.ok
    assert found.summary()["unfinished"] == found.unfinished
    for name, ends in found.ends.items():
        assert ends == compared.ends[name]
    for rung in compared.ends:
        assert (rung in found.ends) != (rung in found.unfinished.replace("->", "").split(": ")[1].split(", "))
    assert [each.summary() for each in found.pairs] == [
        each.summary() for each in compared.pairs[: len(found.pairs)]
    ]
    assert np.isfinite(found.until).all()


@pytest.mark.few(1)
@pytest.mark.parametrize("looks", [10, 20, 40, 60])
def test_a_diagnosis_keeps_the_changes_that_were_tried(looks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {"inputs": PUSHES, "tol": 1e-8, "other_parameters": {"mu": 0.9, "mass": 3.0}}
    whole = rw.diagnose("push", "kinematic", "dynamic-compliant", **asked)
    hand = Hand(monkeypatch, looks)
    monkeypatch.setattr("rungwise.simulation.turns.TURN_S", 0.0)
    try:
        found = rw.diagnose("push", "kinematic", "dynamic-compliant", limit=1e9, on_progress=hand, **asked)
    except rw.LimitError as error:
        assert "motions on both rungs" in str(error)
        return
    assert found.left.items() <= whole.left.items()
    if found.unfinished:
        assert found.unfinished in str(found) and found.cause != "no difference"
    else:
        assert found.causes == whole.causes and found.left == whole.left


@pytest.mark.few(1)
@pytest.mark.parametrize("strides", [(2.0, 4.0)])
@pytest.mark.parametrize("looks", [12, 20])
def test_a_doomed_set_keeps_whole_rounds(
    strides: tuple[float, ...], looks: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    whole = doomed(None, strides=strides)
    found = doomed(1e9, strides=strides, on_progress=Hand(monkeypatch, looks), out=tmp_path)
    assert ((found.cells == whole.cells) | (found.cells == rw.Label.UNKNOWN)).all()
    assert bool(found.unfinished) == (len(found.steps) < len(strides)) and not whole.unfinished
    assert rw.load_doomed_set(tmp_path).unfinished == found.unfinished


@pytest.mark.few(1)
@pytest.mark.parametrize("looks", [0, 2, 8])
def test_a_set_that_a_limit_ends_is_resumed(
    looks: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made = partial(rw.feasible_set, "two_finger", "kinematic", ("v1", "v2"), tol=0.02, threads=1)
    whole = made()
    with monkeypatch.context() as patch:
        hand = Hand(patch, looks)
        try:
            assert not made(limit=1e9, out=tmp_path, on_progress=hand).complete
        except rw.LimitError as error:
            assert "first cells" in str(error)
    again = made(out=tmp_path, resume=True)
    assert again.complete and again.evaluations == whole.evaluations
    points = whole.random(500, 0)
    assert (again.labels(points) == whole.labels(points)).all()


def test_runs_that_a_limit_ends_certify_nothing(
    known: rw.FeasibleSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begun and not ended counts as wrong; not begun does not count."""
    whole = known.certify(50, threads=1)
    run = rw.Batch.run

    def cut(own: rw.Batch, points: Any, **options: Any) -> rw.Results:
        found = run(own, points, **options)
        found.outcome[30:] = rw.Code.RUNNING
        found.final[35:] = np.nan
        return found

    monkeypatch.setattr(rw.Batch, "run", cut)
    found = known.certify(50, threads=1)
    assert found.samples == 35 and 5 <= found.wrong <= whole.wrong + 5 and found.near <= whole.near
    assert found.bound > whole.bound


def test_runs_that_a_limit_ends_count_as_wrong_whatever_the_set_says(
    known: rw.FeasibleSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the set, as they do, leaves open what they come to."""
    run = rw.Batch.run

    def cut(own: rw.Batch, points: Any, **options: Any) -> rw.Results:
        found = run(own, points, **options)
        found.outcome[:] = rw.Code.RUNNING
        return found

    monkeypatch.setattr(rw.Batch, "run", cut)
    monkeypatch.setattr(
        rw.FeasibleSet, "_labels", lambda _, places: np.full(len(places), int(rw.Label.UNKNOWN))
    )
    found = known.certify(20, threads=1)
    assert (found.samples, found.wrong, found.near, found.bound) == (20, 20, 0, 1.0)


def test_parts_of_a_limit_add_up_to_the_whole() -> None:
    deadline = Deadline(90.0)
    assert 29.0 < (deadline.share(3) or 0.0) <= 30.0 and Deadline().share(3) is None
