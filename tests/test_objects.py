"""Results compare, hash and pickle: whatever is public answers `==` by content or by identity."""

from __future__ import annotations

import dataclasses
import enum
import inspect
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
import rungwise.gym
from rungwise.content import ByContent, same
from rungwise.hierarchy import paths
from rungwise.world.rollout import RolloutKeywords
from rungwise.world.run import RunKeywords

PUBLIC = [value for name in rw.__all__ if inspect.isclass(value := getattr(rw, name))]
BOX = {"v2": (0.2, 1.2)}


def _plan(v2: float) -> rw.Plan:
    scene = rw.load("two_finger")
    segments = (rw.Segment({"v2": v2}, 1.0),)
    return rw.Plan(scene, scene.parameters(), segments, moves=np.array([[v2, np.nan]]), seed=3)


def _verified(v2: float) -> rw.Verification:
    plan = dataclasses.replace(_plan(v2), stage=rw.Stage(rw.KINEMATIC, 1e-3), tol=1e-3)
    return rw.verify(plan, "kinematic", samples=3, seed=1)


MADE: dict[str, Callable[[float], Any]] = {
    "Scene": lambda v: rw.load(
        {"name": "a", "duration": v, "bodies": {"b": {"role": "obstacle", "shape": {"kind": "halfplane"}}}}
    ),
    "SpaceScene": lambda v: rw.load("ball").changed(duration=v),
    "Segment": lambda v: rw.Segment({"v2": v}, 1.0),
    "RunOptions": lambda v: rw.RunOptions(parameters={"v2": v}, motion={"part.x3": np.nan}),
    "Results": lambda v: rw.Batch("two_finger", "kinematic", ["v2"]).run(np.array([[v]])),
    "Rollouts": lambda v: rw.rollout("two_finger", "kinematic", parameters={"v2": [v]}),
    "FeasibleSet": lambda v: rw.feasible_set(
        "two_finger", "kinematic", ["v2"], box=BOX, tol=0.2, parameters={"v1": v}
    ),
    "Answers": lambda v: rw.ask("two_finger", "goal", rw.State.of("two_finger", {"part.x3": v - 1})),
    "Geometry": lambda v: rw.geometry("two_finger", rw.State.of("two_finger", {"part.x3": v - 1})),
    "Plan": _plan,
    "Verification": _verified,
    "Diagnosis": lambda v: rw.diagnose(
        "two_finger", "kinematic", "dynamic-rigid", parameters={"v2": v}, tol=0.01
    ),
    "Closure": lambda v: rw.force_closure(
        [(v, 0.0), (-v, 0.0)], [(-1.0, 0.0), (1.0, 0.0)], [0.5, 0.5]
    ),
    "Rung": lambda v: rw.DYNAMIC_RIGID.with_inertia(v),
}  # fmt: skip


@pytest.mark.few(7)
@pytest.mark.parametrize("name", MADE)
def test_results_are_equal_by_content_and_copies_of_them_are(name: str) -> None:
    made, again, other = MADE[name](0.9), MADE[name](0.9), MADE[name](0.95)
    assert type(made).__name__ == name
    assert made == made and made != other and made != 1 and (made == other) is False
    assert made == pickle.loads(pickle.dumps(made))
    if name not in ("Plan", "Verification", "Diagnosis"):
        assert made == again
    assert hash(made) == hash(pickle.loads(pickle.dumps(made)))
    assert len({made, pickle.loads(pickle.dumps(made)), other}) == 2


def test_every_public_result_answers() -> None:
    """By identity, by content, or by fields of which each is a plain value."""
    for kind in PUBLIC:
        if not dataclasses.is_dataclass(kind) or kind.__eq__ is object.__eq__:
            continue
        if issubclass(kind, ByContent) or kind in (rw.Scene, rw.SpaceScene):
            assert not kind.__dataclass_params__.eq or kind is rw.SpaceScene, kind  # type: ignore[attr-defined]
            continue
        plain = {"str", "int", "float", "bool", "Rung", "Rung | str"}
        assert {str(f.type) for f in dataclasses.fields(kind)} <= plain, kind


PATHS = {name: each for name, each in vars(paths).items() if isinstance(each, paths.Path)}


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
def test_paths_of_a_comparison_can_be_kept(path: paths.Path) -> None:
    assert pickle.loads(pickle.dumps(path)) == path


def test_runs_are_themselves_and_can_be_kept() -> None:
    run, again = (rw.simulate("two_finger", "quasistatic-rigid") for _ in range(2))
    assert run == run and run != again and len({run, again}) == 2
    copied = pickle.loads(pickle.dumps(run))
    assert copied.scene == run.scene and copied.trajectory.identical(run.trajectory)


def test_runs_in_space_can_be_kept_and_gone_on_from() -> None:
    pytest.importorskip("mujoco")
    run = rw.simulate("ball", "dynamic-rigid", duration=0.05)
    copied = pickle.loads(pickle.dumps(run))
    assert copied.scene == run.scene and copied.trajectory.identical(run.trajectory)
    assert isinstance(copied, rw.SpaceRun) and copied.space is not None
    further = [
        rw.simulate("ball", "dynamic-rigid", state=each.state, duration=0.1).final for each in (run, copied)
    ]
    assert further[0] == further[1]


def test_a_run_under_way_says_what_can_be_kept_of_it() -> None:
    simulation = rw.Simulation("two_finger", "kinematic")
    assert simulation == simulation and hash(simulation)
    with pytest.raises(TypeError, match="keep its `state`"):
        pickle.dumps(simulation)


@pytest.mark.parametrize(
    ("a", "b", "equal"),
    [
        (np.nan, float("nan"), True),
        (np.array([np.nan]), np.array([np.nan]), True),
        (np.array([1.0]), np.array([[1.0]]), False),
        ({"a": np.zeros(2)}, {"a": np.zeros(2)}, True),
        ({"a": np.zeros(2)}, {"b": np.zeros(2)}, False),
        ((np.zeros(2), 1), (np.zeros(2), 1.0), True),
        ([np.zeros(2)], (np.zeros(2),), False),
        (np.array([{"a": [1]}], object), np.array([{"a": [1]}], object), True),
        (np.zeros(2), [0.0, 0.0], False),
        (len, len, True),
        (len, sum, False),
    ],
)
def test_same(a: object, b: object, equal: bool) -> None:
    assert same(a, b) is same(b, a) is equal


@pytest.mark.parametrize("scene", ["two_finger", "push", "ball"])
def test_the_state_before_the_first_step_is_the_start(scene: str) -> None:
    simulation = rw.Simulation(scene, "dynamic-rigid")
    start = simulation.state
    assert start.time == 0.0 and np.array_equal(start.q, rw.State.of(scene).q)
    while simulation.advance():
        pass
    whole, gone_on = simulation.result(), rw.simulate(scene, "dynamic-rigid", state=start)
    assert np.array_equal(start.v, whole.states[0].v)
    assert (whole.outcome, whole.steps, whole.final) == (gone_on.outcome, gone_on.steps, gone_on.final)


def test_a_name_that_is_not_there_suggests_one() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'simulat'; did you mean simulate\?"):
        _ = rw.simulat
    assert not hasattr(rw, "zzz") and hasattr(rw, "__version__")


USER = """
import rungwise as rw

scene = rw.load("two_finger")
run = rw.simulate(scene, "kinematic")
run.finl
rw.simulate("two_finger", "kinematic", durration=3)
rw.plan(scene, seed="one")
assert isinstance(scene, rw.Scene)
reveal_type(rw.simulate(scene, "kinematic", parameters={"v2": 0.9}))
reveal_type(rw.rollout(scene, "kinematic", parameters={"v2": [0.9]}))
reveal_type(rw.load(scene))
reveal_type(rw.load_run("folder").final)
"""


@pytest.mark.long
def test_a_type_checker_finds_mistakes_in_a_script(tmp_path: Path) -> None:
    (tmp_path / "user.py").write_text(USER)
    root = Path(__file__).parents[1]
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", root / "pyproject.toml", tmp_path / "user.py"],
        cwd=root, capture_output=True, text=True,
    )  # fmt: skip
    told = [line.partition("user.py:")[2] for line in checked.stdout.splitlines() if "user.py" in line]
    mistakes = {line.split(":")[0] for line in told if "error" in line}
    assert mistakes == {"6", "7", "8"}, checked.stdout
    types = [line.partition("Revealed type is ")[2].strip('"') for line in told if "Revealed" in line]
    assert [name.rpartition(".")[2] for name in types[:3]] == ["Run", "Rollouts", "Scene"]
    assert "dict" in types[3]


@pytest.mark.parametrize(("function", "told"), [(rw.simulate, RunKeywords), (rw.rollout, RolloutKeywords)])
def test_type_checkers_know_every_keyword(function: Callable[..., Any], told: Any) -> None:
    parameters = inspect.signature(function).parameters.values()
    own = {p.name: p.annotation for p in parameters if p.kind is p.KEYWORD_ONLY}
    assert own == {name: ref.__forward_arg__ for name, ref in told.__annotations__.items()}


def test_errors_of_wrong_input_are_public() -> None:
    """All but that of a step with more contacts than it has room for, which is tried again with more room."""
    sources = Path(rw.__file__).parent.rglob("*.py")
    kind = re.compile(r"^class (\w+)\((?:InputError|SceneError)\b", re.MULTILINE)
    own = {name for source in sources for name in kind.findall(source.read_text("utf-8"))}
    assert own - {*rw.__all__, *rungwise.gym.__all__} == {"Crowded"}


FUNCTIONS = [value for name in rw.__all__ if inspect.isfunction(value := getattr(rw, name))]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_every_parameter_of_a_public_function_is_described_and_signatures_are_short(
    function: Callable[..., Any],
) -> None:
    signature, said = inspect.signature(function), function.__doc__ or ""
    missing = [name for name in signature.parameters if not re.search(rf"\b{name}s?\b", said)]
    assert not missing
    assert all(len(repr(p.default)) < 40 for p in signature.parameters.values())


METHODS = [
    (kind, method)
    for name in rw.__all__
    if inspect.isclass(kind := getattr(rw, name))
    for word, method in inspect.getmembers(kind, inspect.isroutine)
    if not word.startswith("_") and getattr(method, "__module__", None) == kind.__module__
]


def test_every_parameter_of_a_public_method_is_described() -> None:
    assert len(METHODS) > 50
    for kind, method in [*METHODS, (rw.SceneBuilder, rw.SceneBuilder.__init__)]:
        said = (method.__doc__ or "") + (kind.__doc__ or "")
        for name in inspect.signature(method).parameters:
            assert name in ("self", "cls") or re.search(rf"\b{name}s?\b", said), (method.__qualname__, name)


def test_the_same_search_twice_gives_equal_plans() -> None:
    """Whatever their seconds were."""
    first, second = (rw.plan("two_finger", schedule=["kinematic"], task_seed=1, seed=2) for _ in range(2))
    assert first.found and first == second and hash(first) == hash(second)
    assert first.records[0].seconds != second.records[0].seconds


CLASSES = [kind for name in rw.__all__ if inspect.isclass(kind := getattr(rw, name))]


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_public_field_and_method_of_a_class_is_described(kind: type) -> None:
    own = [each for each in kind.__mro__ if each.__module__.startswith("rungwise")]
    said = "\n".join(each.__doc__ or "" for each in own)
    fields = getattr(kind, "__dataclass_fields__", None) or getattr(kind, "_fields", ())
    after = r'\s*:[^\n]*\n\s+"""'  # a field may have a text of its own below it
    texts = "\n".join(inspect.getsource(each) for each in own)
    missing = [
        name
        for name in fields
        if not name.startswith("_")
        and not re.search(rf"\b{name}\b", said)
        and not re.search(name + after, texts)
    ]
    bare = [
        name
        for each in own
        for name, value in vars(each).items()
        if not name.startswith("_")
        and name not in vars(enum.Enum)
        and (inspect.isroutine(value) or type(value) is property)
        and not inspect.getdoc(value)
    ]
    assert not missing and not bare
