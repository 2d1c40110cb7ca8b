"""Conditions that must hold for a time, ``part.x > 1 and part.y < 2 for 0.2``, in the grammar of Python.

`for` binds weaker than all else within its parentheses: all that stands before it must hold, and what stands
after it is a time. Such a condition is rewritten into a call, which the grammar of expressions knows.
"""

from __future__ import annotations

import ast
import re
import warnings

FOR, REST = "_for", "rest"
"""The function that ``X for T`` is rewritten into, and the one that asks for rest."""
_TURN = re.compile(r"(?<![\w.])angle_about\(\s*(\w+)\s*,\s*([xyz])\s*\)")
_OWN = re.compile(rf"(?<!\w){FOR}(?!\w)")
_MARKS = re.compile(r"(?<![\w.])for(?!\w)|[()\[\]{},]")


class ExpressionError(ValueError):
    """The text is not an expression of this grammar, or contains an unknown name."""


class _Part:
    """A text between two parentheses or commas: what was read of it, and what stood before `for`."""

    def __init__(self, opened: str) -> None:
        self.opened, self.text, self.held = opened, "", ""
        self.lasts = False

    def closed(self) -> str:
        return _call(self.held, self.text) if self.lasts else self.text


def rewritten(text: str) -> str:
    """The text with ``X for T`` as a call, and ``angle_about(body, z)`` by the body's quaternion. Raises
    ExpressionError where a part of it is missing."""
    text = _TURN.sub(_turn, text)
    if _OWN.search(text):
        raise ExpressionError(f"unknown name {FOR}")
    if "for" not in text:
        return text
    parts, at = [_Part("")], 0
    for mark in _MARKS.finditer(text):
        parts[-1].text += text[at : mark.start()]
        at = mark.end()
        _take(parts, mark.group())
    parts[-1].text += text[at:]
    while len(parts) > 1:
        inner = parts.pop()
        parts[-1].text += inner.opened + inner.closed()
    return parts[0].closed()


def _turn(found: re.Match[str]) -> str:
    """How far a body is turned about an axis of the world, -pi to pi: of the turn about this axis that is
    left when what tilts the axis is taken off (the twist)."""
    w, own = f"{found[1]}.qw", f"{found[1]}.q{found[2]}"
    return f"atan2(2 * {w} * {own}, {w} * {w} - {own} * {own})"


def _take(parts: list[_Part], mark: str) -> None:
    """Go on behind a mark."""
    part = parts[-1]
    if mark == "for" and part.opened in ("", "("):
        if part.lasts:
            raise ExpressionError("'for' stands twice; put parentheses around the inner '... for ...'")
        part.held, part.text, part.lasts = part.text, "", True
    elif mark in "([{":
        parts.append(_Part(mark))
    elif mark == ",":
        part.text = part.closed() + mark if part.lasts else part.text + mark
        part.lasts = False
    elif len(parts) > 1:
        parts.pop()
        parts[-1].text += part.opened + part.closed() + mark
    else:
        part.text += mark


def _call(held: str, span: str) -> str:
    held, span = held.strip(), span.strip()
    if not held:
        raise ExpressionError("'for' stands behind the condition that must hold")
    if not span:
        raise ExpressionError("'for' needs a time behind it, in the scene's unit of time")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            node = ast.parse(span, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(
            f"{span[:60]!r} is no time; behind 'for' stands a number in the scene's unit of time"
        ) from None
    if isinstance(node, ast.BoolOp | ast.Compare | ast.UnaryOp) and not _is_number(node):
        raise ExpressionError(
            f"{span[:60]!r} is no time; put parentheses around '... for ...' where a condition goes on"
        )
    return f"{FOR}(({held}), ({span}))"


def _is_number(node: ast.expr) -> bool:
    return isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.Not)


def parsed(text: str) -> ast.expr:
    """The syntax tree of a condition that compiles."""
    return ast.parse(rewritten(text.strip()), mode="eval").body


def written(node: ast.expr) -> str:
    """The text of a tree, with `for` as its author writes it."""
    return restored(ast.unparse(node))


def restored(text: str) -> str:
    """A text with all calls of `FOR` as ``(X for T)``."""
    while (at := text.rfind(f"{FOR}(")) >= 0:
        first, depth, comma = at + len(FOR) + 1, 1, -1
        end = first
        while end < len(text) and depth:
            depth += (text[end] in "([{") - (text[end] in ")]}")
            comma = end if text[end] == "," and depth == 1 else comma
            end += 1
        comma = end - 1 if comma < 0 else comma
        held, span = text[first:comma].strip(), text[comma + 1 : end - 1].strip()
        text = f"{text[:at]}({held} for {span}){text[end:]}"
    return text


def lasting_of(node: ast.expr) -> tuple[ast.expr, ast.expr] | None:
    """What must hold, and for how long; None where a condition asks for no time."""
    match node:
        case ast.Call(ast.Name(name), [held, span]) if name == FOR:
            return held, span
    return None


class _Momentary(ast.NodeTransformer):
    def visit_Call(self, node: ast.Call) -> ast.AST:
        pair = lasting_of(node)
        return node if pair is None else self.visit(pair[0])


def momentary(condition: str) -> str:
    """A condition without its times: what must hold at each moment of them."""
    if "for" not in condition:
        return condition
    return ast.unparse(_Momentary().visit(parsed(condition)))


def names_in(condition: str) -> set[str]:
    """The plain names in a condition that compiles, and those before a dot."""
    return {node.id for node in ast.walk(parsed(condition)) if isinstance(node, ast.Name)}
