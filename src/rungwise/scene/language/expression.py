"""Expressions of a scene: text -> whitelisted syntax tree -> bytecode -> one interpreter.

Grammar: numbers, names, ``+ - * / **``, comparisons, ``and or not``, ``a if condition else b`` and the
functions of `FUNCTIONS`. Nothing is ever evaluated by Python.

A condition compiles to a *signed margin*: ``a <= b`` is ``b - a``, ``and`` the least, ``or`` the greatest,
``not`` the negative; it holds where the margin is >= 0. A strict comparison has a negative margin at
equality. A comparison with a value that is not a number does not hold.

``X for T`` holds where X has held for the time T. Runs note since when X holds, in a slot of the values
(`Lasting`); while it does not, the margin is that of X less T; then less the time that is left; and that of X
once T is over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rungwise.kernel import Ints, Reals, inner_kernel, kernel

STACK = 64

CONSTANT, LOAD, SELECT, STRICT, NEEDED, LASTS = 0, 1, 2, 3, 4, 5
ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, MINIMUM, MAXIMUM, ATAN2, HYPOT, MARGIN = (
    10,
    11,
    12,
    13,
    14,
    15,
    16,
    17,
    18,
    19,
)
NEGATE, ABSOLUTE, SQRT, EXP, LOG, SIN, COS, TAN, ASIN, ACOS, ATAN, SIGN, FLOOR = (
    30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42,
)  # fmt: skip

FUNCTIONS: dict[str, tuple[int, int]] = {
    "abs": (ABSOLUTE, 1), "sqrt": (SQRT, 1), "exp": (EXP, 1), "log": (LOG, 1), "sin": (SIN, 1),
    "cos": (COS, 1), "tan": (TAN, 1), "asin": (ASIN, 1), "acos": (ACOS, 1), "atan": (ATAN, 1),
    "sign": (SIGN, 1), "floor": (FLOOR, 1), "min": (MINIMUM, 2), "max": (MAXIMUM, 2),
    "atan2": (ATAN2, 2), "hypot": (HYPOT, 2),
}  # fmt: skip
CONSTANTS = {"pi": math.pi, "deg": math.pi / 180.0, "inf": math.inf}

TIMES = 4
"""Most times `for` may stand in one condition."""
CONDITIONS = ("goal", "unsafe", "doomed", "until")
"""Conditions of which runs know how long their parts have held, each with `TIMES` slots, in this order."""
SLOTS = TIMES * len(CONDITIONS)


@dataclass
class Code:
    """Bytecode of one expression: rows (operation, argument), the constants, and the slots it reads; and its
    parts that must hold for a time, inner ones first."""

    rows: list[tuple[int, int]] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    reads: set[int] = field(default_factory=set)
    lasting: list[Lasting] = field(default_factory=list)


@dataclass(frozen=True)
class Lasting:
    """A condition that must hold for a time: programs of both, and the slot of the time since when it has
    held: inf where it does not, -inf once it has held long enough."""

    held: Code
    span: Code
    slot: int


class Programs:
    """Many bytecodes in three arrays, as the interpreter takes them.

    `code` (n, 2) int64, `constants` (k,) float64, `table` (programs, 2) int64 first and last row of each.
    """

    def __init__(self, codes: list[Code]) -> None:
        rows: list[tuple[int, int]] = []
        constants: list[float] = []
        table: list[tuple[int, int]] = []
        for code in codes:
            start = len(rows)
            rows += [(op, arg + len(constants) if op == CONSTANT else arg) for op, arg in code.rows]
            constants += code.constants
            table.append((start, len(rows)))
        self.code = np.array(rows, np.int64).reshape(-1, 2)
        self.constants = np.array(constants, np.float64)
        self.table = np.array(table, np.int64).reshape(-1, 2)

    def reads(self, slots: range) -> bool:
        """Whether some bytecode reads one of these slots."""
        loaded = self.code[self.code[:, 0] == LOAD, 1]
        return bool(((loaded >= slots.start) & (loaded < slots.stop)).any())


@inner_kernel
def evaluate(code: Ints, constants: Reals, start: int, stop: int, values: Reals, stack: Reals) -> float:
    """Value of the program in rows start..stop of `code`, reading names from `values`; `stack` is scratch.
    Zero has no sign: which of -0 and 0 is the greater differs from machine to machine."""
    return _run(code, constants, start, stop, values, stack, False) + 0.0


@kernel
def evaluate_all(
    code: Ints, constants: Reals, table: Ints, values: Reals, stack: Reals, found: Reals
) -> None:
    """Fill found (k,) with the values of all programs of a table (k, 2)."""
    for k in range(table.shape[0]):
        found[k] = evaluate(code, constants, table[k, 0], table[k, 1], values, stack)


@inner_kernel
def holds(code: Ints, constants: Reals, start: int, stop: int, values: Reals, stack: Reals) -> bool:
    """Whether a condition, compiled as above, holds; evaluation ends once that is known."""
    return _run(code, constants, start, stop, values, stack, True) >= 0.0


@kernel
def _run(
    code: Ints, constants: Reals, start: int, stop: int, values: Reals, stack: Reals, only_sign: bool
) -> float:
    top = -1
    for row in range(start, stop):
        operation = code[row, 0]
        if operation == CONSTANT:
            top += 1
            stack[top] = constants[code[row, 1]]
        elif operation == LOAD:
            top += 1
            stack[top] = values[code[row, 1]]
        elif operation == SELECT:
            top -= 2
            stack[top] = stack[top + 1] if stack[top] >= 0.0 else stack[top + 2]
        elif operation == STRICT:
            if stack[top] == 0.0:
                stack[top] = -5e-324
        elif operation == NEEDED:
            if only_sign and stack[top] < 0.0:
                break
        elif operation == LASTS:
            top -= 3
            stack[top] = _lasting(stack[top], stack[top + 1], stack[top + 2], stack[top + 3])
        elif operation < NEGATE:
            top -= 1
            stack[top] = _binary(operation, stack[top], stack[top + 1])
        else:
            stack[top] = _unary(operation, stack[top])
    value: float = stack[top]
    return value


@kernel
def _lasting(margin: float, span: float, now: float, since: float) -> float:
    """Margin of a condition that must hold for a time. Only the run says when the time is over."""
    if not margin >= 0.0:
        return margin - span
    if span == 0.0 or since == -math.inf:
        return margin
    return -span if since == math.inf else min(now - since - span, -5e-324)


@kernel
def _binary(operation: int, a: float, b: float) -> float:
    if operation == ADD:
        return a + b
    if operation == SUBTRACT:
        return a - b
    if operation == MULTIPLY:
        return a * b
    if operation == DIVIDE:
        return a / b
    if operation == MINIMUM:
        return b if b < a or math.isnan(b) else a
    if operation == MAXIMUM:
        return b if b > a or math.isnan(b) else a
    if operation == MARGIN:
        return _margin(a, b)
    if operation == POWER:
        return a**b
    if operation == ATAN2:
        return math.atan2(a, b)
    return math.hypot(a, b)


@kernel
def _margin(a: float, b: float) -> float:
    """a - b, also at infinity; -inf where one of them is not a number."""
    if a == b:
        return 0.0
    return -math.inf if math.isnan(a) or math.isnan(b) else a - b


@kernel
def _unary(operation: int, a: float) -> float:
    if operation == NEGATE:
        return -a
    if operation == ABSOLUTE:
        return abs(a)
    if operation == SQRT:
        return math.sqrt(a)
    if operation == EXP:
        return math.exp(a)
    if operation == LOG:
        return math.log(a)
    if operation == SIN:
        return math.sin(a)
    if operation == COS:
        return math.cos(a)
    if operation == TAN:
        return math.tan(a)
    if operation == ASIN:
        return math.asin(a)
    if operation == ACOS:
        return math.acos(a)
    if operation == ATAN:
        return math.atan(a)
    if operation == SIGN:
        return np.sign(a)
    return np.floor(a)
