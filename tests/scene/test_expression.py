"""The expression language: values as Python's, conditions as signed margins, and every refusal."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rungwise.scene.language.compiler import MAX_LENGTH, MAX_NODES, compile_expression
from rungwise.scene.language.expression import FUNCTIONS, STACK, Programs, evaluate, holds
from rungwise.scene.language.lasting import ExpressionError

NAMES = ("a", "b", "part.x", "gap(f, g)")
VALUES = np.array([0.75, -2.5, 3.0, 0.125])


def lookup(function: str, dotted: tuple[str, ...]) -> int | None:
    name = f"{function}({', '.join(dotted)})" if function else dotted[0]
    return NAMES.index(name) if name in NAMES else None


def value(text: str, *, condition: bool = False) -> float:
    programs = Programs([compile_expression(text, lookup, lambda _: "; valid: a, b", condition=condition)])
    return float(evaluate(programs.code, programs.constants, *programs.table[0], VALUES, np.zeros(STACK)))


def refusal(text: str, *, condition: bool = False) -> str:
    with pytest.raises(ExpressionError) as caught:
        compile_expression(text, lookup, lambda _: "; valid: a, b", condition=condition)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 200
    return message


def smallest(*values: float) -> float:
    return math.nan if any(math.isnan(v) for v in values) else min(values)


def largest(*values: float) -> float:
    return math.nan if any(math.isnan(v) for v in values) else max(values)


PYTHON = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sign": np.sign,
    "floor": np.floor,
    "min": smallest,
    "max": largest,
    "atan2": np.arctan2,
    "hypot": np.hypot,
    "pi": np.float64(math.pi),
    "deg": np.float64(math.pi / 180),
    "inf": np.float64(math.inf),
    "a": VALUES[0],
    "b": VALUES[1],
    "__builtins__": {},
}


def python(text: str) -> float:
    """What Python makes of the text with numbers that follow IEEE 754."""
    with np.errstate(all="ignore"):
        return float(eval(text, dict(PYTHON)))


literals = st.floats(-1e3, 1e3, allow_subnormal=False).map(lambda x: f"_({x!r})") | st.integers(-9, 9).map(
    lambda n: f"_({n})"
)
PYTHON["_"] = np.float64


def numbers(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    comparisons = st.tuples(inner, st.sampled_from(["<", "<=", ">", ">="]), inner).map(
        lambda x: f"({x[0]} {x[1]} {x[2]})"
    )
    tests = comparisons | st.tuples(comparisons, st.sampled_from(["and", "or"]), comparisons).map(
        lambda x: f"(not {x[0]} {x[1]} {x[2]})"
    )
    return st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda x: f"({x[0]} {x[1]} {x[2]})"),
        st.tuples(inner, st.sampled_from(["-", "+"])).map(lambda x: f"({x[1]}{x[0]})"),
        st.tuples(inner, st.sampled_from(["2", "3", "0.5", "a"])).map(lambda x: f"(abs({x[0]}) ** {x[1]})"),
        st.sampled_from([f for f, (_, n) in FUNCTIONS.items() if n == 1]).flatmap(
            lambda f: inner.map(lambda x: f"{f}({x})")
        ),
        st.sampled_from(["atan2", "hypot", "min", "max"]).flatmap(
            lambda f: st.tuples(inner, inner).map(lambda x: f"{f}({x[0]}, {x[1]})")
        ),
        st.tuples(inner, tests, inner).map(lambda x: f"({x[0]} if {x[1]} else {x[2]})"),
    )


expressions = st.recursive(literals | st.sampled_from(["a", "b", "pi", "deg"]), numbers, max_leaves=8)


@pytest.mark.long
@settings(deadline=None, derandomize=True, max_examples=300)
@given(expressions)
def test_value_is_that_of_python(text: str) -> None:
    expected = python(text)
    got = value(text.replace("_", ""))
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-9, nan_ok=True), text


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("x", ["0.3", "-0.3", "0", "2.5", "-2.5", "inf", "(0 / 0)"])
def test_every_function(name: str, x: str) -> None:
    text = f"{name}({', '.join([x, '0.7'][: FUNCTIONS[name][1]])})"
    expected = python(text.replace("(0 / 0)", "(inf - inf)"))
    assert value(text) == pytest.approx(expected, rel=1e-12, nan_ok=True)


def test_names_and_constants() -> None:
    assert value("a") == 0.75
    assert value("part.x + gap(f, g)") == 3.125
    assert value("180 * deg") == math.pi
    assert value("pi") == math.pi
    assert value("inf") == math.inf
    assert value("-inf") == -math.inf
    assert value("max(1, 2, a, 7, 3)") == 7.0
    assert value("min(1, 2, b, 7)") == -2.5
    assert value("  \n 1e-6 ") == 1e-6
    assert value("2 ** 3 ** 2") == 512.0
    assert value("-2 ** 2") == -4.0


@pytest.mark.parametrize("text", ["max(-{}, 0)", "min(0, -{})", "-{}", "{} * -1", "floor(-{})"])
def test_zero_has_no_sign(text: str) -> None:
    assert math.copysign(1.0, value(text.format("(a - 0.75)"))) == 1.0


def test_not_a_number_is_never_hidden() -> None:
    for text in (
        "min(0/0, 1)",
        "min(1, 0/0)",
        "max(0/0, 1)",
        "max(1, 0/0)",
        "sign(0/0)",
        "inf - inf",
        "sqrt(-1)",
    ):
        assert math.isnan(value(text)), text


@pytest.mark.parametrize(
    ("text", "margin"),
    [
        ("a <= 1", 0.25),
        ("1 >= a", 0.25),
        ("a < 1", 0.25),
        ("1 > a", 0.25),
        ("a >= 1", -0.25),
        ("b > 0", -2.5),
        ("a <= 1 and b <= 0", 0.25),
        ("a <= 1 or b <= 0", 2.5),
        ("a >= 1 or b >= 0", -0.25),
        ("not a <= 1", -0.25),
        ("not (a >= 1 and b <= 0)", 0.25),
        ("0 < a < 1", 0.25),
        ("0 <= a <= 0.5 <= 2", -0.25),
        ("3 > a > b", 2.25),
        ("not not a <= 1", 0.25),
        ("a <= inf", math.inf),
        ("inf <= a", -math.inf),
        ("a <= (1 if b < 0 else 0)", 0.25),
    ],
)
def test_margin_of_a_condition(text: str, margin: float) -> None:
    assert value(text, condition=True) == margin


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("a <= 0.75", True),
        ("a < 0.75", False),
        ("a >= 0.75", True),
        ("a > 0.75", False),
        ("not a <= 0.75", False),
        ("not a < 0.75", True),
        ("not not a < 0.75", False),
        ("not not a <= 0.75", True),
        ("0.75 <= a <= 0.75", True),
        ("0.75 <= a < 0.75", False),
        ("inf <= inf", True),
        ("inf < inf", False),
        ("-inf <= -inf and inf >= inf", True),
        ("0/0 <= 1", False),
        ("0/0 > 1", False),
        ("not 0/0 <= 1", True),
        ("1 > 0 and 0/0 <= 1", False),
        ("0/0 <= 1 and 1 > 0", False),
        ("1 > 0 or 0/0 <= 1", True),
        ("0/0 <= 1 or 1 > 0", True),
    ],
)
def test_equality_and_what_is_not_a_number(text: str, holds: bool) -> None:
    assert (value(text, condition=True) >= 0.0) is holds
    assert value(f"1 if {text} else 2") == (1.0 if holds else 2.0)


@pytest.mark.long
@settings(deadline=None, derandomize=True, max_examples=200)
@given(st.lists(st.sampled_from(["a", "b", "0", "0.75", "-2.5", "inf"]), min_size=2, max_size=4), st.data())
def test_conditions_hold_where_python_says_so(operands: list[str], data: st.DataObject) -> None:
    text = operands[0]
    for operand in operands[1:]:
        text += f" {data.draw(st.sampled_from(['<', '<=', '>', '>=']))} {operand}"
    text = data.draw(st.sampled_from([text, f"not {text}", f"{text} and a > 0", f"a < 0 or not ({text})"]))
    assert (value(text, condition=True) >= 0.0) is bool(python(text)), text


PARTS = st.sampled_from(["a > 0", "b > 0", "a < b", "inf - inf < a", "b <= -2.5"])
NESTED = st.recursive(
    PARTS,
    lambda inner: st.one_of(
        inner.map(lambda x: f"not ({x})"),
        st.tuples(inner, inner).map(lambda x: f"({x[0]}) and ({x[1]})"),
        st.tuples(inner, inner).map(lambda x: f"({x[0]}) or ({x[1]})"),
        inner.map(lambda x: f"(1 if {x} else 2) < 1.5"),
    ),
    max_leaves=6,
)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(NESTED)
def test_a_condition_holds_where_its_margin_is_not_negative(text: str) -> None:
    programs = Programs([compile_expression(text, lookup, lambda _: "; valid: a, b", condition=True)])
    found = holds(programs.code, programs.constants, *programs.table[0], VALUES, np.zeros(STACK))
    assert found is (value(text, condition=True) >= 0.0), text


REFUSED = {
    "": "is not an expression",
    "1 +": "is not an expression",
    "a b": "is not an expression",
    "a = 1": "is not an expression",
    "import os": "is not an expression",
    "a\n+ 1": "is not an expression",
    "\0": "is not an expression",
    "(" * 500: "is not an expression",
    "lambda": "is not an expression",
    "1if a < 2else 3": "is not an expression",
    "'\\d'": "is not an expression",
    "c": "unknown name c; valid: a, b",
    "a.b": "unknown name a.b",
    "t": "unknown name t",
    "__import__": "unknown name __import__",
    "__import__(os)": "unknown name __import__(os)",
    "__import__('os')": "stands where a name is wanted",
    "open(a)": "unknown name open(a)",
    "gap(f, h)": "unknown name gap(f, h)",
    "gap()": "unknown name gap()",
    "gap(f)": "unknown name gap(f)",
    "a.__class__": "unknown name a.__class__",
    "(1).real": "stands where a name is wanted",
    "().__class__.__bases__": "stands where a name is wanted",
    "a()": "unknown name a()",
    "a.b()": "is not allowed",
    "sqrt(a)(b)": "is not allowed",
    "sqrt": "unknown name sqrt",
    "sqrt()": "sqrt takes 1 value, not 0",
    "sqrt(1, 2)": "sqrt takes 1 value, not 2",
    "atan2(1)": "atan2 takes 2 values, not 1",
    "min(1)": "min takes two or more values",
    "max()": "max takes two or more values",
    "sqrt(x=1)": "is not allowed",
    "min(*a)": "min takes two or more values",
    "min(1, *a)": "is not allowed",
    "min(1, 2, key=a)": "is not allowed",
    "sqrt(*a)": "is not allowed",
    "'text'": "is not allowed",
    "b'x'": "is not allowed",
    "f'{a}'": "is not allowed",
    "None": "is not allowed",
    "...": "is not allowed",
    "True": "True and False are not numbers",
    "1j": "is not allowed",
    "[a]": "is not allowed",
    "{a}": "is not allowed",
    "{}": "is not allowed",
    "(a, b)": "is not allowed",
    "a[0]": "is not allowed",
    "a // b": "is not allowed",
    "a % b": "is not allowed",
    "a @ b": "is not allowed",
    "a << b": "is not allowed",
    "a | b": "is not allowed",
    "~a": "is not allowed",
    "lambda: a": "is not allowed",
    "[x for x in a]": "is not allowed",
    "(a := 1)": "is not allowed",
    "await a": "is not allowed",
    "(yield)": "is not allowed",
    "a < b": "a condition stands where a number is wanted",
    "a and b": "a condition stands where a number is wanted",
    "not a": "a condition stands where a number is wanted",
    "1 if a else b": "'a' is not a condition",
    "9" * 400: "a number is too large",
    "1" * (MAX_LENGTH + 1): "longer than 40000 characters",
    "+".join("a" * (MAX_NODES // 3)): "more than 300 terms",
    "-" * MAX_NODES + "a": "more than 300 terms",
    "a+(" * 70 + "a" + ")" * 70: "nested too deeply",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: ascii(text[:30]))
def test_refused_as_a_number(text: str) -> None:
    assert REFUSED[text] in refusal(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a", "'a' is not a condition; compare with <=, <, >= or >"),
        ("1", "is not a condition"),
        ("True", "is not a condition"),
        ("a <= 1 and b", "'b' is not a condition"),
        ("not a", "'a' is not a condition"),
        ("min(a, b)", "is not a condition"),
        ("a == b", "compare with"),
        ("a != b", "compare with"),
        ("a is b", "compare with"),
        ("a in b", "compare with"),
        ("a < b < (a < b)", "a condition stands where"),
        ("a < c", "unknown name c; valid: a, b"),
        ("a <", "is not an expression"),
        ("a <= 1 if b < 0 else a >= 1", "is not a condition"),
        ("(a <= 1) + 1 < 2", "a condition stands where"),
    ],
)
def test_refused_as_a_condition(text: str, message: str) -> None:
    assert message in refusal(text, condition=True)


@pytest.mark.parametrize("bracket", ["[]", "{}", "()"])
@pytest.mark.parametrize("depth", [50, 100, 140, 199, 250])
def test_deep_nesting_is_refused_in_words(bracket: str, depth: int) -> None:
    left, right = bracket
    refusal(left * depth + "~1" + right * depth)


def test_stack_is_deep_enough_for_what_compiles() -> None:
    deepest = "a+(" * (STACK - 1) + "a" + ")" * (STACK - 1)
    assert value(deepest) == pytest.approx(0.75 * STACK)
    refusal(f"1+({deepest})")


def test_nothing_reaches_standard_error() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        refusal("1if a < 2 else 3")
    assert not caught


@settings(deadline=None, derandomize=True, max_examples=300)
@given(st.text(alphabet="ab.()[]{}+-*/<>=!~,'\":;#@ \n\t0123456789eE_ifelsandornotlmk", max_size=60))
def test_any_text_is_an_expression_or_refused(text: str) -> None:
    for condition in (False, True):
        try:
            compile_expression(text, lookup, lambda _: "; valid: a, b", condition=condition)
        except ExpressionError as error:
            assert "\n" not in str(error)
