"""Scenes as searches see them: goals made narrower, for a reserve, and what to keep out of as unsafe."""

from __future__ import annotations

import ast

from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.task import Task as TaskFields
from rungwise.scene.language.lasting import FOR, lasting_of, parsed, written
from rungwise.scene.language.names import OF_CONTACTS
from rungwise.scene.language.poses import OF_POSES


def tightened(condition: str, reserve: float) -> str:
    """The condition with the bound of each comparison nearer by this part of its size.

    `a <= b` becomes `a <= b - reserve * abs(b)` where a depends on the state and b does not, and so on;
    inside "not" it turns around. Comparisons with no side, or two sides, that depend on the state stay, and
    so do the times for which conditions must hold, and rest.
    """
    return written(_tightened(parsed(condition), reserve))


def _tightened(node: ast.expr, part: float) -> ast.expr:
    match node:
        case ast.BoolOp(op, parts):
            return ast.BoolOp(op, [_tightened(each, part) for each in parts])
        case ast.UnaryOp(ast.Not(), inner):
            return ast.UnaryOp(ast.Not(), _tightened(inner, -part))
        case ast.Compare(left, operators, rights):
            sides = [left, *rights]
            each = [_nearer(a, op, b, part) for a, op, b in zip(sides, operators, rights, strict=False)]
            return each[0] if len(each) == 1 else ast.BoolOp(ast.And(), each)
    pair = lasting_of(node)
    if pair is not None:
        return ast.Call(ast.Name(FOR, ast.Load()), [_tightened(pair[0], part), pair[1]], [])
    return node


def _nearer(left: ast.expr, operator: ast.cmpop, right: ast.expr, part: float) -> ast.expr:
    """The comparison, its bound nearer by this part of its size."""
    below = isinstance(operator, ast.Lt | ast.LtE)
    if _varies(left) and not _varies(right):
        right = _moved(right, -part if below else part)
    elif _varies(right) and not _varies(left):
        left = _moved(left, part if below else -part)
    return ast.Compare(left, [operator], [right])


def _moved(bound: ast.expr, part: float) -> ast.expr:
    size = ast.Call(ast.Name("abs", ast.Load()), [bound], [])
    change = ast.BinOp(ast.Constant(abs(part)), ast.Mult(), size)
    return ast.BinOp(bound, ast.Add() if part > 0.0 else ast.Sub(), change)


def _varies(node: ast.expr) -> bool:
    """Whether an expression depends on the state: it names a coordinate, a function of bodies, or t."""
    names = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    dotted = any(isinstance(each, ast.Attribute) for each in ast.walk(node))
    return dotted or bool(names & {"t", "speed", *OF_CONTACTS, *OF_POSES})


def search_scene(scene: AnyScene, fields: TaskFields, reserve: float) -> AnyScene:
    """The scene with the goal tightened by the reserve, and with what to keep out of as unsafe."""
    goal = scene.file.goal
    assert goal is not None
    changes = {"goal": tightened(goal, reserve)} | _unsafe(scene, fields)
    return scene.changed(**changes)


def guarded_scene(scene: AnyScene) -> AnyScene:
    """The scene with what its task keeps out of as unsafe."""
    fields = scene.file.task
    if fields is None or not fields.keep_out:
        return scene
    changes = _unsafe(scene, fields)
    return scene.changed(**changes)


def _unsafe(scene: AnyScene, fields: TaskFields) -> dict[str, str]:
    """The unsafe condition, joined with what to keep out of; empty where there is neither."""
    conditions = [f"({text})" for text in (scene.file.unsafe, *fields.keep_out) if text is not None]
    return {"unsafe": " or ".join(conditions)} if conditions else {}
