"""The compiler of expressions: text -> whitelisted syntax tree -> bytecode (see `expression`)."""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from rungwise.scene.language.expression import (
    ADD,
    CONSTANT,
    CONSTANTS,
    DIVIDE,
    FUNCTIONS,
    LASTS,
    LOAD,
    MARGIN,
    MAXIMUM,
    MINIMUM,
    MULTIPLY,
    NEEDED,
    NEGATE,
    POWER,
    SELECT,
    STACK,
    STRICT,
    SUBTRACT,
    TIMES,
    Code,
    Lasting,
    Programs,
    evaluate,
)
from rungwise.scene.language.lasting import FOR, REST, ExpressionError, restored, rewritten
from rungwise.scene.language.poses import OF_POSES, expanded
from rungwise.scene.language.units import Conversion, converted

MAX_LENGTH = 40_000
MAX_NODES = 300
_BINARY: dict[type[ast.operator], int] = {
    ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE, ast.Pow: POWER,
}  # fmt: skip

Lookup = Callable[[str, tuple[str, ...]], int | None]
"""(function name or '', dotted names) -> slot in the values, or None when there is no such quantity."""


def compile_expression(
    text: str,
    lookup: Lookup,
    choices: Callable[[str], str],
    *,
    condition: bool = False,
    slots: Sequence[int] = (),
    units: Mapping[str, Conversion] = MappingProxyType({}),
) -> Code:
    """Bytecode of `text`.

    `lookup` resolves names to slots; `choices` says what is valid in place of an unknown name; `slots` are
    those of times since when parts hold, none where that is not known; `units` says how names are converted
    where they are read. Raises ExpressionError, with one line
    that names the fault.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"longer than {MAX_LENGTH} characters")
    text = rewritten(text.strip())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "error"
            )  # such as "1if x < 2 else 3": Python's word on it would go to stderr
            tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{restored(text)[:60]!r} is not an expression") from None
    for part in tree.values if isinstance(tree, ast.BoolOp) else [tree]:  # rest of many objects is a long one
        if sum(1 for _ in ast.walk(part)) > MAX_NODES:
            raise ExpressionError(f"more than {MAX_NODES} terms")
    tree = converted(tree, units)
    compiler = _Compiler(text, lookup, choices, list(slots))
    if condition:
        compiler.condition(tree, needed=True)
    else:
        compiler.number(tree)
    if compiler.deepest > STACK:
        raise ExpressionError("nested too deeply")
    return compiler.code


class _Compiler:
    def __init__(
        self, text: str, lookup: Lookup, choices: Callable[[str], str], slots: list[int] | None
    ) -> None:
        self.text = text
        self.slots = slots
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
                slots, self.slots = self.slots, None
                self.condition(test)
                self.slots = slots
                self.number(body)
                self.number(orelse)
                self._emit(SELECT, 0, -2)
            case ast.Call(ast.Name(name)) if name in (FOR, REST):
                raise ExpressionError("a condition stands where a number is wanted")
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
            case ast.Call(ast.Name(name), [held, span], []) if name == FOR:
                self._lasting(held, span)
            case ast.Call(ast.Name(name), [body], []) if name == REST:
                self._rest(body)
            case _:
                raise ExpressionError(f"{self._show(node)} is not a condition; compare with <=, <, >= or >")

    def _rest(self, body: ast.expr) -> None:
        """Compile rest: the tolerance less how far the body goes in a nominal step."""
        if self.lookup(REST, (self._dotted(body),)) is not None:
            self._name("", ast.Name("tolerance"))
        self._name(REST, body)
        self._emit(MARGIN, 0, -1)

    def _lasting(self, held: ast.expr, span: ast.expr) -> None:
        """Compile a condition that must hold for a time: its margin, the time, now, and since when it has."""
        inner, time = self._part(held, True), self._part(span, False)
        if not self.slots:
            raise ExpressionError(
                f"'for' stands at most {TIMES} times in one of goal, unsafe, doomed and until, and nowhere"
                " else: only runs know how long these have held"
            )
        now = self.lookup("", ("t",))
        assert now is not None
        if now in time.reads:
            raise ExpressionError(f"{self._show(span)} is no time to hold for: it changes with t")
        _check_span(time, self._show(span))
        slot = self.slots.pop(0)
        self.code.lasting += [*inner.lasting, Lasting(inner, time, slot)]
        for part in (inner, time):
            first = len(self.code.constants)
            self.code.constants += part.constants
            self.code.reads |= part.reads
            self.code.rows += [(op, arg + first if op == CONSTANT else arg) for op, arg in part.rows]
        self.deepest = max(self.deepest, self.depth + 4)
        self.code.rows += [(LOAD, now), (LOAD, slot), (LASTS, 0)]
        self.depth += 1

    def _part(self, node: ast.expr, is_condition: bool) -> Code:
        """The program of a part of its own, which takes slots of this one's."""
        inner = _Compiler(self.text, self.lookup, self.choices, self.slots if is_condition else None)
        (inner.condition if is_condition else inner.number)(node)
        self.deepest = max(self.deepest, self.depth + 1 + inner.deepest)
        return inner.code

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
            whole = expanded(name, [self._dotted(arg) for arg in args]) if name in OF_POSES else None
            if whole is None:
                self._name(name, *args)
            else:
                self.number(whole)
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
        return repr(restored(ast.get_source_segment(self.text, node) or self.text)[:60])


def _check_span(span: Code, shown: str) -> None:
    """Raise ExpressionError where the time of a `for` is a number that none can hold for."""
    if span.reads:
        return
    programs = Programs([span])
    value = evaluate(programs.code, programs.constants, 0, len(span.rows), np.zeros(0), np.zeros(STACK))
    if not 0.0 <= value < math.inf:
        raise ExpressionError(f"{shown} is no time to hold for: it must be finite and >= 0, not {value:g}")
