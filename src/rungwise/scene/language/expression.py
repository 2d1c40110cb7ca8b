"""Expressions of a scene: text -> whitelisted syntax tree -> bytecode -> one interpreter.

Grammar: numbers, names, ``+ - * / **``, comparisons, ``and or not``, ``a if condition else b`` and the
functions of `FUNCTIONS`. Nothing is ever evaluated by Python.

A condition compiles to a *signed margin*: ``a <= b`` is ``b - a``, ``and`` the least, ``or`` the greatest,
``not`` the negative; it holds where the margin is >= 0. A strict comparison has a negative margin at
equality. A comparison with a value that is not a number does not hold.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rungwise.kernel import Ints, Reals, inner_kernel, kernel

MAX_LENGTH = 2000
MAX_NODES = 300
STACK = 64

CONSTANT, LOAD, SELECT, STRICT, NEEDED = 0, 1, 2, 3, 4
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
_BINARY: dict[type[ast.operator], int] = {
    ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE, ast.Pow: POWER,
}  # fmt: skip

Lookup = Callable[[str, tuple[str, ...]], int | None]
"""(function name or '', dotted names) -> slot in the values, or None when there is no such quantity."""


class ExpressionError(ValueError):
    """The text is not an expression of this grammar, or contains an unknown name."""


@dataclass
class Code:
    """Bytecode of one expression: rows (operation, argument), the constants, and the slots it reads."""

    rows: list[tuple[int, int]] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    reads: set[int] = field(default_factory=set)


def compile_expression(
    text: str, lookup: Lookup, choices: Callable[[str], str], *, condition: bool = False
) -> Code:
    """Bytecode of `text`.

    `lookup` resolves names to slots; `choices` says what is valid in place of an unknown name. Raises
    ExpressionError, with one line that names the fault.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"longer than {MAX_LENGTH} characters")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "error"
            )  # such as "1if x < 2 else 3": Python's word on it would go to stderr
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{text[:60]!r} is not an expression") from None
    if sum(1 for _ in ast.walk(tree)) > MAX_NODES:
        raise ExpressionError(f"more than {MAX_NODES} terms")
    compiler = _Compiler(text.strip(), lookup, choices)
    if condition:
        compiler.condition(tree, needed=True)
    else:
        compiler.number(tree)
    if compiler.deepest > STACK:
        raise ExpressionError("nested too deeply")
    return compiler.code


class _Compiler:
    def __init__(self, text: str, lookup: Lookup, choices: Callable[[str], str]) -> None:
        self.text = text
        self.code = Code()
        self.lookup = lookup
        self.choices = choices
        self.depth = self.deepest = 0

    def number(self, node: ast.expr) -> None:
        match node:
            case ast.Constant(value=bool()):
                raise ExpressionError("True and False are not numbers")
            case ast.Constant(value=int() | float() as value):
                self._constant(value)
            case ast.Name() | ast.Attribute():
                self._name("", node)
            case ast.BinOp(left, op, right) if type(op) in _BINARY:
                self._apply(_BINARY[type(op)], self.number, left, right)
            case ast.UnaryOp(ast.USub(), operand):
                self._apply(NEGATE, self.number, operand)
            case ast.UnaryOp(ast.UAdd(), operand):
                self.number(operand)
            case ast.IfExp(test, body, orelse):
                self.condition(test)
                self.number(body)
                self.number(orelse)
                self._emit(SELECT, 0, -2)
            case ast.Call(ast.Name(name), args, keywords) if not keywords:
                self._call(name, args)
            case ast.Compare() | ast.BoolOp() | ast.UnaryOp(ast.Not(), _):
                raise ExpressionError("a condition stands where a number is wanted")
            case _:
                raise ExpressionError(
                    f"{self._show(node)} is not allowed; use + - * / **, numbers, names and functions"
                )

    def condition(self, node: ast.expr, needed: bool = False) -> None:
        """Compile a condition; `needed`: the whole condition does not hold without it."""
        match node:
            case ast.Compare(left, ops, comparators):
                operands = [left, *comparators]
                for i, op in enumerate(ops):
                    self._compare(operands[i], op, operands[i + 1])
                    if i:
                        self._emit(MINIMUM, 0, -1)
            case ast.BoolOp(op, values):
                needed = needed and isinstance(op, ast.And)
                for i, value in enumerate(values):
                    self.condition(value, needed)
                    if needed:
                        self._emit(NEEDED, 0, 0)
                    if i:
                        self._emit(MINIMUM if isinstance(op, ast.And) else MAXIMUM, 0, -1)
            case ast.UnaryOp(ast.Not(), operand):
                self._apply(NEGATE, self.condition, operand)
                self._emit(STRICT, 0, 0)
            case _:
                raise ExpressionError(f"{self._show(node)} is not a condition; compare with <=, <, >= or >")

    def _compare(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> None:
        if isinstance(op, ast.LtE | ast.Lt):
            left, right = right, left
        elif not isinstance(op, ast.GtE | ast.Gt):
            raise ExpressionError(
                "compare with <=, <, >= or > (equality of real numbers never holds for long)"
            )
        self._apply(MARGIN, self.number, left, right)
        if isinstance(op, ast.Lt | ast.Gt):
            self._emit(STRICT, 0, 0)

    def _call(self, name: str, args: list[ast.expr]) -> None:
        if name not in FUNCTIONS:
            self._name(name, *args)
            return
        operation, arity = FUNCTIONS[name]
        if name in ("min", "max"):
            if len(args) < 2:
                raise ExpressionError(f"{name} takes two or more values")
            self.number(args[0])
            for arg in args[1:]:
                self.number(arg)
                self._emit(operation, 0, -1)
        elif len(args) != arity:
            raise ExpressionError(f"{name} takes {arity} value{'s' if arity > 1 else ''}, not {len(args)}")
        else:
            self._apply(operation, self.number, *args)

    def _apply(self, operation: int, visit: Callable[[ast.expr], None], *args: ast.expr) -> None:
        for arg in args:
            visit(arg)
        self._emit(operation, 0, 1 - len(args))

    def _name(self, function: str, *nodes: ast.expr) -> None:
        dotted = tuple(self._dotted(node) for node in nodes)
        if not function and dotted[0] in CONSTANTS:
            self._constant(CONSTANTS[dotted[0]])
            return
        slot = self.lookup(function, dotted)
        if slot is None:
            name = f"{function}({', '.join(dotted)})" if function else dotted[0]
            raise ExpressionError(f"unknown name {name[:60]}{self.choices(name)}")
        self.code.reads.add(slot)
        self._emit(LOAD, slot, 1)

    def _constant(self, value: float) -> None:
        try:
            self.code.constants.append(float(value))
        except OverflowError:
            raise ExpressionError("a number is too large") from None
        self._emit(CONSTANT, len(self.code.constants) - 1, 1)

    def _emit(self, operation: int, argument: int, grows: int) -> None:
        self.code.rows.append((operation, argument))
        self.depth += grows
        self.deepest = max(self.deepest, self.depth)

    def _dotted(self, node: ast.expr) -> str:
        match node:
            case ast.Name(name):
                return name
            case ast.Attribute(value, attribute):
                return f"{self._dotted(value)}.{attribute}"
            case _:
                raise ExpressionError(f"{self._show(node)} stands where a name is wanted")

    def _show(self, node: ast.expr) -> str:
        return repr((ast.get_source_segment(self.text, node) or self.text)[:60])


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


@inner_kernel
def evaluate(code: Ints, constants: Reals, start: int, stop: int, values: Reals, stack: Reals) -> float:
    """Value of the program in rows start..stop of `code`, reading names from `values`; `stack` is scratch.
    Zero has no sign: which of -0 and 0 is the greater differs from machine to machine."""
    return _run(code, constants, start, stop, values, stack, False) + 0.0


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
        elif operation < NEGATE:
            top -= 1
            stack[top] = _binary(operation, stack[top], stack[top + 1])
        else:
            stack[top] = _unary(operation, stack[top])
    value: float = stack[top]
    return value


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
