"""The package with other values of named numbers, as `search_numbers.py` imports it in another process."""

from __future__ import annotations

import ast
import importlib.abc
import importlib.machinery
import importlib.util
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

PACKAGE = Path(__file__).parents[1] / "src/rungwise"
Factors = Mapping[str, Mapping[str, float]]
"""Factors by file below the package, then by name."""


def times(value: Any, by: float) -> Any:
    """A number, or numbers, times a factor. Counts stay at least 1, parts of a whole stay parts (their odds
    are multiplied), and factors of growth stay above 1 (what they add is)."""
    if isinstance(value, tuple):
        return tuple(times(each, by) for each in value)
    if isinstance(value, int):
        return max(1, round(value * by))
    if 0.0 < value < 1.0:
        return by * value / (1.0 - value + by * value)
    return 1.0 + (value - 1.0) * by if value > 1.0 else value * by


def changed(text: str, factors: Mapping[str, float]) -> str:
    """A module's text in which numbers are changed directly after they are named, on the same line."""
    lines, count = text.split("\n"), 0
    for statement in ast.parse(text).body:
        own = [name for name in named(statement) if name in factors]
        count += len(own)
        if own:
            last, end = (statement.end_lineno or 1) - 1, statement.end_col_offset
            after = "".join(f"; {name} = _times({name}, {factors[name]!r})" for name in own)
            lines[last] = (
                f"{lines[last][:end]}; from changed_numbers import times as _times{after}{lines[last][end:]}"
            )
    assert count == len(factors), sorted(factors)
    return "\n".join(lines)


def named(statement: ast.stmt) -> list[str]:
    """The names that a statement of a module gives values to."""
    if not isinstance(statement, ast.Assign | ast.AnnAssign):
        return []
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    return [part.id for part in ast.walk(target) if isinstance(part, ast.Name)]


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads a module with its numbers changed; what is kept of the module itself is not read."""

    def __init__(self, fullname: str, path: str, factors: Mapping[str, float]) -> None:
        super().__init__(fullname, path)
        self.factors = factors

    def get_code(self, _fullname: str) -> CodeType:
        text = changed(Path(self.path).read_text("utf-8"), self.factors)
        return compile(text, self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, factors: Factors) -> None:
        self.factors = factors

    def find_spec(
        self, fullname: str, _path: Sequence[str] | None, _target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        file = f"{fullname.partition('.')[2].replace('.', '/')}.py"
        if not fullname.startswith("rungwise.") or file not in self.factors:
            return None
        at = str(PACKAGE / file)
        return importlib.util.spec_from_file_location(
            fullname, at, loader=_Loader(fullname, at, self.factors[file])
        )


def install(factors: Factors) -> None:
    """From now on modules of the package are imported with these numbers. None may be imported yet."""
    assert not any(name.startswith("rungwise.") for name in sys.modules)
    sys.meta_path.insert(0, _Finder(factors))


def uses(file: str, name: str) -> Iterator[tuple[Path, int]]:
    """Files and lines that read a number, in its own module and in those that import it."""
    module = f"rungwise.{file.removesuffix('.py').replace('/', '.')}"
    of_module = re.compile(rf"\b{re.escape(module.rpartition('.')[2])}\.{name}\b")
    for path, text in _texts().items():
        if name not in text:
            continue
        if path == PACKAGE / file or (module, name) in _imports(path):
            yield from ((path, line) for line in _reads(path).get(name, ()))
        else:
            yield from ((path, n) for n, line in enumerate(text.split("\n"), 1) if of_module.search(line))


@cache
def _texts() -> dict[Path, str]:
    return {path: path.read_text("utf-8") for path in PACKAGE.rglob("*.py")}


@cache
def _imports(path: Path) -> set[tuple[str, str]]:
    """What a file imports by name, as (module, name)."""
    return {
        (part.module or "", each.name)
        for part in ast.walk(ast.parse(_texts()[path])) if isinstance(part, ast.ImportFrom)
        for each in part.names
    }  # fmt: skip


@cache
def _reads(path: Path) -> dict[str, list[int]]:
    """The lines of a file that read a name."""
    found: dict[str, list[int]] = {}
    for part in ast.walk(ast.parse(_texts()[path])):
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load):
            found.setdefault(part.id, []).append(part.lineno)
    return found


@cache
def _has_kernels(path: Path) -> bool:
    return re.search(r"^@\w*kernel\b", _texts()[path], re.MULTILINE) is not None


def in_kernels(file: str, name: str) -> bool:
    """Whether the number is read where kernels are compiled, or may be: they keep it as it was."""
    return any(_has_kernels(path) for path, _ in uses(file, name))


def kernels_of(file: str, name: str) -> set[tuple[str, str]]:
    """The functions that read a number, as (module below the package, function)."""
    found = set[tuple[str, str]]()
    for path, line in uses(file, name):
        module = path.relative_to(PACKAGE).as_posix().removesuffix(".py").removesuffix("/__init__")
        for function, first, last in _functions(path):
            if first <= line <= last:
                found.add((module.replace("/", "."), function))
    return found


@cache
def _functions(path: Path) -> list[tuple[str, int, int]]:
    """The functions of a file, with their first and last lines."""
    return [
        (part.name, part.lineno, part.end_lineno or part.lineno)
        for part in ast.parse(_texts()[path]).body if isinstance(part, ast.FunctionDef)
    ]  # fmt: skip


def compiled(folder: Path) -> set[tuple[str, str]]:
    """The kernels that a cache holds, as (module below the package, function): those that were called."""
    names = [file.name.rsplit(".", 3)[:2] for file in folder.glob("*/*")]
    return {(name[0], name[1]) for name in names if len(name) == 2}


@contextmanager
def watching(names: Mapping[str, Sequence[str]]) -> Iterator[set[tuple[str, str]]]:
    """The numbers, as (file, name), that Python reads on the way."""
    lines: dict[str, dict[int, list[tuple[str, str]]]] = {}
    for file, own in names.items():
        for name in own:
            for path, line in uses(file, name):
                lines.setdefault(str(path), {}).setdefault(line, []).append((file, name))
    read: set[tuple[str, str]] = set()

    def trace(frame: FrameType, _event: str, _argument: object) -> Any:
        here = lines.get(frame.f_code.co_filename)
        if here is None:
            return None

        def follow(frame: FrameType, _event: str, _argument: object) -> Any:
            read.update(here.get(frame.f_lineno, ()))
            return follow

        return follow

    sys.settrace(trace)
    try:
        yield read
    finally:
        sys.settrace(None)
