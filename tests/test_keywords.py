"""Wrong calls are answered in one line, which lists the right keywords and names, and suggests a spelling."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import pytest

import rungwise as rw
from rungwise.keywords import KeywordError, keywords
from rungwise.wording import choices

FUNCTIONS = [
    value for name in rw.__all__ if callable(value := getattr(rw, name)) and not inspect.isclass(value)
]


@keywords
def example(scene: str, model: str, *, tol: float = 0.1, seed: int = 0) -> str:
    return f"{scene} {model} {tol} {seed}"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: example("a", "b", told=1),
            "example: unknown keyword 'told' (did you mean tol?); valid: scene,",
        ),  # type: ignore[call-arg]
        (lambda: example("a", "b", 3), "example: 3 arguments without a keyword, and it takes 2"),  # type: ignore[misc]
        (lambda: example("a", scene="b"), "example.scene: is given twice"),  # type: ignore[misc]
        (lambda: example("a"), "example.model: is required"),  # type: ignore[call-arg]
    ],
)
def test_what_a_wrong_call_is_told(call: Callable[[], str], words: str) -> None:
    with pytest.raises(KeywordError) as caught:
        call()
    assert str(caught.value).startswith(words) and "\n" not in str(caught.value)
    assert isinstance(caught.value, TypeError)


def test_right_calls_and_errors_within_pass_through() -> None:
    assert example("a", model="b", seed=2) == "a b 0.1 2"

    @keywords
    def broken() -> None:
        example(1, 2, 3)  # type: ignore[arg-type, misc]

    @keywords
    def wrong() -> int:
        return len(3)  # type: ignore[arg-type]

    with pytest.raises(KeywordError, match="example: 3 arguments"):
        broken()
    with pytest.raises(TypeError, match="has no len") as caught:
        wrong()
    assert not isinstance(caught.value, KeywordError)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_signatures_are_explicit(function: Callable[..., object]) -> None:
    """`help` and completion show every keyword; one that does not exist is answered in a line."""
    kinds = {parameter.kind for parameter in inspect.signature(function).parameters.values()}
    assert inspect.Parameter.VAR_KEYWORD not in kinds
    with pytest.raises(TypeError, match="keyword"):
        function(no_such_keyword=1)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: rw.simulate("pussh", "kinematic"), "did you mean push?"),
        (lambda: rw.simulate("push", "kinamatic"), "did you mean kinematic?"),
        (lambda: rw.simulate("push", "kinematic", parameters={"mus": 1.0}), "did you mean mu_s?"),
        (lambda: rw.plan("push", schedule="climbs"), "did you mean climb?"),
        (lambda: rw.ask(rw.load("push"), "bok.x > 1", rw.State.of(rw.load("push"))), "did you mean box.x?"),
        (lambda: rw.Batch("push", "kinematic", ["goalx"]), "did you mean goal_x?"),
    ],
)
def test_names_are_suggested(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError) as caught:
        call()
    assert words in str(caught.value) and "valid: " in str(caught.value) and "\n" not in str(caught.value)


def test_choices_are_cut_and_never_empty() -> None:
    assert choices("zzz", []) == "; valid: none"
    assert choices("b99", [f"b{k}" for k in range(100)]).startswith(" (did you mean b99?); valid: b0, ")
    assert choices(3, ["a"]) == "; valid: a"


def test_dir_shows_the_public_names_only() -> None:
    assert sorted(name for name in dir(rw) if not name.startswith("_")) == sorted(rw.__all__)
