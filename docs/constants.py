"""The named numbers of the source, and what each decides, as a page.

    python docs/constants.py                       after a change of a constant, or of `constants.txt`
    python docs/constants.py --open                numbers that decide, and have neither a test nor a factor

Values and meanings are read from the modules; kinds, what a far smaller or greater number does, and the tests
that hold it, from `constants.txt`. `tests/test_constants.py` fails where a number is in no table.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
SOURCE = FOLDER.parent / "src" / "rungwise"
ROOMS = ("contact", "models", "simulation", "system", "world", "sets", "fitting", "planning", "hierarchy")
DECIDING = ("verdict", "acceptance", "search")
PLAIN = ("speed", "size", "code")


@dataclass(frozen=True)
class Constant:
    """A number, or a tuple of numbers, that a module names; its file is below `src/rungwise`."""

    file: str
    name: str
    value: Any
    meaning: str


@dataclass(frozen=True)
class Entry:
    """A line of `constants.txt`: names of a file, the kind, what a far smaller and a far greater number does,
    tests with their signs, the unit."""

    file: str
    names: tuple[str, ...]
    kind: str
    smaller: str = ""
    greater: str = ""
    held: str = ""
    unit: str = ""

    @property
    def tests(self) -> list[str]:
        """The tests, below `tests`."""
        return [word for word in self.signed if word not in "-+"]

    @property
    def signed(self) -> list[str]:
        """The tests, each after its signs."""
        return f" {self.held}".partition(" free ")[0].split()

    @property
    def free(self) -> float:
        """The factor within which the number is free, or 0."""
        return self._after("free")

    @property
    def work(self) -> float:
        """How many times the work searches then take, or 0 where this is about the same."""
        return self._after("work")

    def _after(self, word: str) -> float:
        following = f" {self.held}".partition(f" {word} ")[2].split()
        return float(following[0]) if following else 0.0


def constants() -> Iterator[Constant]:
    """All numbers that modules of the rooms name in capitals, in the order of the files."""
    for room in ROOMS:
        for file in sorted((SOURCE / room).rglob("*.py")):
            yield from _of_file(file)


def entries() -> list[Entry]:
    """The lines of `constants.txt`."""
    found, file = [], ""
    for line in (FOLDER / "constants.txt").read_text("utf-8").splitlines():
        if line.startswith("["):
            file = line.strip("[]")
        elif line and not line.startswith("#"):
            names, *others = (part.strip() for part in line.split("|"))
            found.append(Entry(file, tuple(names.split(", ")), *others))
    return found


def unheld(kind: str) -> list[tuple[str, str]]:
    """The numbers of a kind, as (file, name), for which no test and no factor is known."""
    return [
        (entry.file, name)
        for entry in entries() if entry.kind == kind and not entry.tests and not entry.free
        for name in entry.names
    ]  # fmt: skip


def page() -> str:
    """The page, whole."""
    known = {(constant.file, constant.name): constant for constant in constants()}
    listed = entries()
    lines = [*_HEAD, *_summary(listed), ""]
    for room in dict.fromkeys(_room(entry.file) for entry in listed):
        lines += _section(room, [entry for entry in listed if _room(entry.file) == room], known)
    return "\n".join(lines)


_HEAD = """\
# Constants

Which numbers in the source decide an answer, and what would change if one of them were different? For
example, `TOLERANCE` of `solve` decides whether an answer of `rw.solve` counts as solved. A far smaller
value would refuse good answers of ill-conditioned problems, a far greater one would accept rough answers,
and a test fails in both cases.

This page lists the numbers by the room of the source to which they belong. `docs/constants.py` writes it
from the source and from `docs/constants.txt`.

- *What a number decides.* A number that decides a *verdict* settles what a run, a step, a set, a proof or a
  plan is called. A number that decides an *acceptance* settles whether an answer, a step or a state is
  accepted. A number of a *search* settles where and for how long something is searched; other numbers judge
  the result.
- *Units.* A number without a unit is a count, or a fraction of a quantity that its meaning names.
- *Held by.* The last column names the test that fails if the number is far smaller (-) or far greater (+),
  by one or two decades.
- *Free by a factor.* All such numbers may be multiplied or divided by the factor at the same time, and the
  shipped scenes end as before (`python benchmarks/decades.py` tries it). Numbers of searches are free in
  another sense: if all of them are changed at once, each by a random factor up to the given one, nearly all
  answers of small searches stay (`python benchmarks/search_numbers.py` tries it). Such a number changes the
  work, not the answers; if searches then take more than 1.5 times the work, the column says how much.
- *Empty.* If the last column is empty, no test and no factor is known; `python docs/constants.py --open`
  lists these numbers.

""".splitlines()


def _of_file(file: Path) -> Iterator[Constant]:
    path = file.relative_to(SOURCE).as_posix()
    body = ast.parse(file.read_text("utf-8")).body
    for statement, below in zip(body, [*body[1:], None], strict=True):
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
        names = [part.id for part in ast.walk(target) if isinstance(part, ast.Name)]
        if not all(name.strip("_").isupper() for name in names):
            continue
        module = import_module(f"rungwise.{path[:-3].replace('/', '.').removesuffix('.__init__')}")
        for name in names:
            value = getattr(module, name)
            if _is_number(value) or (isinstance(value, tuple) and value and all(map(_is_number, value))):
                yield Constant(path, name, value, _text(below))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _text(statement: ast.stmt | None) -> str:
    """The docstring that a statement is, in one line."""
    if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
        return ""
    return " ".join(str(statement.value.value).split())


def _room(file: str) -> str:
    parts = file.split("/")[:-1]
    return "/".join(parts[:2])


def _section(room: str, listed: list[Entry], known: dict[tuple[str, str], Constant]) -> list[str]:
    lines = [f"## {room}", ""]
    deciding = [entry for entry in listed if entry.kind in DECIDING]
    if deciding:
        lines += [
            "| number | decides | meaning | far smaller | far greater | held by |",
            "|---|---|---|---|---|---|",
        ]
        lines += [_row(room, entry, known) for entry in deciding] + [""]
    for kind, words in (
        ("speed", "Decide which of two ways is taken to one answer"),
        ("size", "Sizes and texts"),
        ("code", "Codes"),
    ):
        names = [f"`{_short(room, e.file)}` {_values(e, known)}" for e in listed if e.kind == kind]
        if names:
            lines += [f"{words}: {'; '.join(names)}.", ""]
    return lines


def _short(room: str, file: str) -> str:
    return file.removeprefix(f"{room}/").removesuffix(".py")


def _row(room: str, entry: Entry, known: dict[tuple[str, str], Constant]) -> str:
    meanings = dict.fromkeys(known[entry.file, name].meaning for name in entry.names)
    number = f"`{_short(room, entry.file)}` {_values(entry, known)}"
    cells = (
        number,
        entry.kind,
        " ".join(filter(None, meanings)),
        entry.smaller,
        entry.greater,
        _tests(entry),
    )
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |".replace("  ", " ")


def _values(entry: Entry, known: dict[tuple[str, str], Constant]) -> str:
    unit = f" {entry.unit}" if entry.unit else ""
    return ", ".join(f"{name} = {_number(known[entry.file, name].value)}{unit}" for name in entry.names)


def _number(value: Any) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(map(_number, value))})"
    text = f"{value:d}" if isinstance(value, int) else f"{value:.10g}"
    return text.replace("e-0", "e-").replace("e+0", "e")


def _tests(entry: Entry) -> str:
    """Tests as their names alone: files are in `constants.txt`."""
    words = [
        word if word in "-+" else f"`{word.rpartition('::')[2].rpartition('/')[2]}`" for word in entry.signed
    ]
    if entry.free:
        words.append(f"free by a factor of {entry.free:g}")
    if entry.work:
        words.append(f"at up to {entry.work:g} times the work")
    return " ".join(words)


def _summary(listed: list[Entry]) -> list[str]:
    lines = ["| decides | numbers | held by a test | free by a factor |", "|---|---|---|---|"]
    for kind in DECIDING:
        mine = [entry for entry in listed if entry.kind == kind]
        held = sum(len(entry.names) for entry in mine if entry.tests)
        free = sum(len(entry.names) for entry in mine if entry.free and not entry.tests)
        lines.append(f"| {kind} | {sum(len(entry.names) for entry in mine)} | {held} | {free} |")
    others = sum(len(entry.names) for entry in listed if entry.kind in PLAIN)
    return [*lines, f"| nothing (speed, sizes, codes) | {others} | | |"]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--open", action="store_true", help="list numbers without a test and a factor")
    if not parser.parse_args().open:
        (FOLDER / "constants.md").write_text(page(), "utf-8")
        return
    for kind in DECIDING:
        found = unheld(kind)
        print(f"{kind}: {len(found)}", *(f"  {file}: {name}" for file, name in found), sep="\n")


if __name__ == "__main__":
    main()
