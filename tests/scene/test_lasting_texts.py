"""How `for` and `rest` are read: precedence, parentheses, and one line on what is wrong."""

from __future__ import annotations

import itertools
import random
from functools import partial
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.task.reserve import tightened
from rungwise.scene.language.lasting import momentary, parsed, rewritten, written

PART = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0, "motion": {"kind": "free"}}
FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}


def scene(**fields: Any) -> rw.Scene:
    bodies = {"part": PART | {"pose": {"y": 1.0}}, "floor": FLOOR}
    parameters = {"wait": {"default": 0.2}, "a": {"default": 1.0}}
    data = {"name": "made", "bodies": bodies, "contacts": [{"between": ["part", "floor"]}]}
    return rw.load(data | {"parameters": parameters} | fields)


SAME = [
    ("part.x > 1 and part.y < 2 for 0.2", "(part.x > 1 and part.y < 2) for 0.2"),
    ("part.x > 1 or part.y < 2 for 0.2", "(part.x > 1 or part.y < 2) for (0.2)"),
    ("not part.x > 1 for 0.2", "(not (part.x > 1)) for 0.2"),
    ("part.x > max(1, a) for min(wait, 3)", "(part.x > max(1, a)) for (min(wait, 3))"),
    ("(part.x > 1 for wait) and part.y < 2", "((part.x > 1) for wait) and (part.y < 2)"),
    ("(part.x > 1 for 0.2) or (part.y < 2 for 0.3)", "((part.x > 1) for 0.2) or ((part.y < 2) for 0.3)"),
    (
        "((part.x > 1 for 0.2) and part.y < 2) for wait / 2",
        "(part.x > 1 for 0.2) and part.y < 2 for wait / 2",
    ),
]


@pytest.mark.parametrize("text, meant", SAME)
def test_for_binds_weaker_than_all_else_in_its_parentheses(text: str, meant: str) -> None:
    own, other = (scene(goal=each).template.conditions for each in (text, meant))
    for name in ("code", "constants", "table"):
        np.testing.assert_array_equal(getattr(own, name), getattr(other, name))
    again = scene(goal=written(parsed(text))).template.conditions
    np.testing.assert_array_equal(own.code, again.code)


WRONG = {
    "part.x > 1 for": "'for' needs a time behind it, in the scene's unit of time",
    "for 0.2": "'for' stands behind the condition that must hold",
    "part.x > 1 for -0.2": "'-0.2' is no time to hold for: it must be finite and >= 0, not -0.2",
    "part.x > 1 for inf": "'inf' is no time to hold for: it must be finite and >= 0, not inf",
    "part.x > 1 for 0.2 s": "'0.2 s' is no time; behind 'for' stands a number in the scene's unit of time",
    "part.x > 1 for 0.2s": "'0.2s' is no time; behind 'for' stands a number in the scene's unit of time",
    "part.x > 1 for 0.2 and part.y < 1": "'0.2 and part.y < 1' is no time; put parentheses around"
    " '... for ...' where a condition goes on",
    "part.x > 1 for 0.2 for 0.3": "'for' stands twice; put parentheses around the inner '... for ...'",
    "part.x > 1 for t": "'t' is no time to hold for: it changes with t",
    "part.x > 1 for wating": "unknown name wating (did you mean wait?)",
    "part.x > 1 for True": "True and False are not numbers",
    "part.x for 0.2": "'part.x' is not a condition; compare with <=, <, >= or >",
    "part.x > (part.y > 1 for 0.2)": "a condition stands where a number is wanted",
    "part.x > (1 if part.y > 1 for 0.2 else 2)": "is no time",
    "part.x > (1 if (part.y > 1 for 0.2) else 2)": "'for' stands at most 4 times in one of goal, unsafe,"
    " doomed and until, and nowhere else: only runs know how long these have held",
    "rest(part) < 1": "a condition stands where a number is wanted",
    "rest(prt)": "unknown name rest(prt) (did you mean rest(part)?)",
    "rest(part.x)": "unknown name rest(part.x)",
    "_for(part.x > 1, 0.2)": "unknown name _for",
    "(part.x > 1 for 0.2": "is not an expression",
    " and ".join(["(part.x > 1 for 0.2)"] * 5): "'for' stands at most 4 times",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_said_in_one_line_with_the_field(text: str) -> None:
    for field in ("goal", "unsafe", "doomed"):
        with pytest.raises(rw.SceneError) as caught:
            scene(**{field: text})
        assert str(caught.value).startswith(f"{field}: ") and "\n" not in str(caught.value)
        assert WRONG[text] in str(caught.value)
    with pytest.raises(rw.ScheduleError, match=r"^inputs.0.until: "):
        rw.simulate(scene(), rw.KINEMATIC, inputs=[{"duration": 1.0, "until": text}])


@pytest.mark.parametrize(
    "fields, path",
    [
        ({"bodies": {"part": PART | {"mass": "1 for 0.2"}, "floor": FLOOR}}, "bodies.part.mass"),
        ({"duration": "1 if a > 0 for 0.2 else 2"}, "duration"),
        ({"goal": "part.x > 1", "task": {"where": "part.x < 1 for 0.2"}}, "task.where"),
    ],
)
def test_for_stands_in_conditions_of_runs_alone(fields: dict[str, Any], path: str) -> None:
    with pytest.raises(rw.SceneError, match=f"^{path}: "):
        scene(**fields)
    with pytest.raises(rw.SceneError, match=r"^condition: 'for' stands at most"):
        rw.ask(scene(), "part.x < 1 for 0.2", np.zeros((1, 3)))


@pytest.mark.long
def test_a_time_that_parameters_make_impossible_is_named() -> None:
    made = scene(goal="part.y < 0.5 for wait", parameters={"wait": {"default": 0.2}})
    run = rw.simulate(made, rw.DYNAMIC_RIGID, parameters={"wait": -0.1})
    assert run.outcome.name == "invalid"
    assert run.reason == "goal: the time after 'for' must be finite and >= 0, not -0.1"
    schedule = [{"duration": 1.0}, {"duration": 1.0, "until": "part.y < 0.5 for -wait"}]
    run = rw.simulate(made, rw.DYNAMIC_RIGID, inputs=schedule)
    assert run.reason == "inputs.1.until: the time after 'for' must be finite and >= 0, not -0.2"
    batch = rw.Batch(made, rw.DYNAMIC_RIGID, ("wait",)).run(np.array([[-0.1], [0.1]]))
    assert batch.outcomes.tolist()[0] == "invalid" and batch.outcomes.tolist()[1] != "invalid"


def test_random_texts_with_for_are_read_back() -> None:
    rng = random.Random(3)

    def made(depth: int) -> str:
        kind = rng.choice(["leaf", "and", "or", "not", "for"]) if depth else "leaf"
        if kind == "leaf":
            return rng.choice(["part.x > 1", "abs(part.y) <= a", "rest(part)", "min(part.x, 2) < max(a, 1)"])
        if kind == "not":
            return f"not ({made(depth - 1)})"
        if kind == "for":
            return f"({made(depth - 1)} for {rng.choice(['0.2', 'wait', 'a * (wait + 1)', 'max(a, wait)'])})"
        return f"({made(depth - 1)}) {kind} ({made(depth - 1)})"

    counted = 0
    for text in itertools.islice(iter(partial(made, 4), None), 300):
        if not 0 < text.count(" for ") <= 4:
            continue
        counted += 1
        own = scene(unsafe=text).template.conditions
        again = scene(unsafe=written(parsed(text))).template.conditions
        np.testing.assert_array_equal(own.code, again.code)
        assert " for " not in momentary(text)
        assert tightened(text, 0.0).count(" for ") == text.count(" for ")
    assert counted > 50


def test_a_reserve_narrows_what_must_hold_and_not_the_time() -> None:
    assert tightened("abs(part.x) <= 0.1 for wait", 0.2) == "(abs(part.x) <= 0.1 - 0.2 * abs(0.1) for wait)"
    assert tightened("rest(part) for 0.3", 0.2) == "(rest(part) for 0.3)"


@pytest.mark.parametrize("name", ["grip_force", "mobile_forward", "before_for", "x_for_y", "_form"])
def test_names_may_hold_the_word_for(name: str) -> None:
    assert rewritten(f"{name} > 1") == f"{name} > 1"
    assert rewritten(f"{name} > 1 for 0.2") == f"_for(({name} > 1), (0.2))"
