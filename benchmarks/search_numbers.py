"""Numbers of searches, all changed at once by factors of their own: what small searches still find.

    python benchmarks/search_numbers.py [--draws 4] [--first 0] [--factor 2] [--only planning/modes]
        [--kinds tasks modes ...] [--kernels] [--blame] [--unread]

`docs/constants.txt` lists numbers that decide a search. Each draw multiplies every one of them by a factor of
its own, between half and twice, and runs the searches of `small_searches.py`: plans of drawn instances, by
contact modes and in space, feasible and doomed sets, fits, diagnoses, designs, comparisons, and contact
problems with a known solution. It prints how many answers stay, and the mean ratio of steps and runs where
they do. Counts stay at least 1, parts of a whole below 1, and factors of growth above 1.

With --blame it looks for the numbers by which an answer is lost, by halves.
Numbers that kernels read are left out, since each draw compiles these anew; --kernels takes them instead.
Numbers that none of these searches reads are no evidence: --unread lists them. Exit code 1 where more than
one answer in fifty is lost.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from changed_numbers import compiled, in_kernels, kernels_of, watching

ROOT = Path(__file__).parents[1]
ALLOWED = 0.02
"""Part of the answers that may be lost."""
FEW = 4
"""Most numbers that are blamed together."""
Number = tuple[str, str]
Factors = dict[Number, float]

CHILD = """
import json, sys
from changed_numbers import install
install(json.loads(sys.argv[1]))
import small_searches
small_searches.main(sys.argv[2:])
"""


def numbers(only: str = "", kernels: bool = False) -> list[Number]:
    """The numbers of searches, as (file, name): those that Python alone reads, or the others."""
    spec = importlib.util.spec_from_file_location("constants", ROOT / "docs/constants.py")
    assert spec is not None and spec.loader is not None
    constants = importlib.util.module_from_spec(spec)
    sys.modules["constants"] = constants
    spec.loader.exec_module(constants)
    found = [
        (entry.file, name)
        for entry in constants.entries() if entry.kind == "search" and entry.file.startswith(only)
        for name in entry.names
    ]  # fmt: skip
    return [each for each in found if in_kernels(*each) == kernels]


def drawn(which: Sequence[Number], draw: int, factor: float) -> Factors:
    """A factor for each number; that of a number does not depend on the others."""
    return {
        number: float(factor ** np.random.default_rng([draw, *map(ord, "/".join(number))]).uniform(-1.0, 1.0))
        for number in which
    }


def answers(factors: Factors, kinds: Sequence[str], cache: str = "") -> dict[str, Any]:
    """What the searches find with the numbers multiplied by these factors; kernels are compiled into `cache`,
    a folder for these factors alone, where they read some."""
    by_file: dict[str, dict[str, float]] = {}
    for (file, name), factor in factors.items():
        by_file.setdefault(file, {})[name] = factor
    command = [sys.executable, "-W", "ignore", "-c", CHILD, json.dumps(by_file), *kinds]
    own = {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), str(ROOT / "src")])}
    if cache:
        own["RUNGWISE_CACHE"] = cache
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True, env=os.environ | own)
    return {answer[0]: answer[1:] for answer in map(json.loads, done.stdout.splitlines())}


def lost(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Names of the answers that are others, and what was raised."""
    names = [name for name, answer in after.items() if name not in before and answer[0] == "raised"]
    for name, (word, values, near, _) in before.items():
        other, others, *_ = after.get(name, ("", []))
        if word != other or any(abs(a - b) > c for a, b, c in zip(values, others, near, strict=True)):
            names.append(name)
    return names


def ratio(before: dict[str, Any], after: dict[str, Any]) -> float:
    """The mean ratio of work of the answers that have one (geometric)."""
    logs = [
        math.log(after[name][3] / answer[3])
        for name, answer in before.items() if name in after and answer[3] and after[name][3]
    ]  # fmt: skip
    return math.exp(float(np.mean(logs))) if logs else 1.0


def of_kinds(before: dict[str, Any], after: dict[str, Any]) -> str:
    """The mean ratios of work, kind by kind, in brackets; nothing where no kind counts its work."""
    kinds = dict.fromkeys(name.partition(":")[0] for name, answer in before.items() if answer[3])
    of_kind = {kind: {name: each for name, each in before.items() if name.startswith(kind)} for kind in kinds}
    words = ", ".join(f"{kind} {ratio(own, after):.2f}" for kind, own in of_kind.items())
    return f" ({words})" if words else ""


def blamed(which: Sequence[Number], loses: Callable[[Sequence[Number]], bool]) -> list[Number]:
    """Few numbers that together lose an answer, where all of `which` do: the last of the shortest beginning
    that does, then the same with this one kept and what stood before it."""
    found, rest = list[Number](), list(which)
    while rest and len(found) < FEW and not (found and loses(found)):
        low, high = 0, len(rest)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if loses([*found, *rest[:middle]]) else (middle, high)
        found.append(rest[high - 1])
        rest = rest[: high - 1]
    return found


def _loses(
    before: dict[str, Any], factors: Factors, name: str, kernels: bool, part: Sequence[Number]
) -> bool:
    """Whether these numbers alone lose an answer; searches of its kind are run."""
    kind, _, test = name.partition(": ")
    with tempfile.TemporaryDirectory() as folder:
        own = {each: factors[each] for each in part}
        after = answers(own, [test if kind == "tests" else kind], folder if kernels else "")
    return name in lost(before, after)


def unread(which: Sequence[Number], kinds: Sequence[str]) -> list[Number]:
    """The numbers that none of these searches reads."""
    by_file: dict[str, list[str]] = {}
    for file, name in which:
        by_file.setdefault(file, []).append(name)
    with watching(by_file) as read:
        import small_searches

        for _, run in small_searches.searches(kinds):
            list(run())
    return [number for number in which if number not in read]


def main(arguments: Sequence[str] | None = None) -> int:
    given = _parser().parse_args(arguments)
    which = numbers(given.only, given.kernels)
    if given.unread:
        print(*("{}: {}".format(*number) for number in unread(which, given.kinds)), sep="\n")
        return 0
    before, most = answers({}, given.kinds), 0
    for draw in range(given.first, given.first + given.draws):
        factors = drawn(which, draw, given.factor)
        with tempfile.TemporaryDirectory() as folder:
            after = answers(factors, given.kinds, folder if given.kernels else "")
            called = compiled(Path(folder))
        gone = lost(before, after)
        most = max(most, len(gone))
        print(
            f"draw {draw}: {len(which)} numbers, {len(before) - len(gone)} of {len(before)} answers stay,"
            f" {ratio(before, after):.2f} times the work{of_kinds(before, after)}",
            flush=True,
        )
        if given.kernels:
            out = [number for number in which if not kernels_of(*number) & called]
            print(
                f"  in no kernel that was called: {len(out)}",
                *map("    {0[0]}: {0[1]}".format, out),
                sep="\n",
            )
        for name in gone:
            print(f"  lost: {name}", flush=True)
            if given.blame:
                for file, own in blamed(which, partial(_loses, before, factors, name, given.kernels)):
                    print(f"    {file} {own} times {factors[file, own]:.2f}", flush=True)
    return int(most > ALLOWED * len(before))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--factor", type=float, default=2.0)
    parser.add_argument("--only", default="", help="beginning of the files, below src/rungwise")
    parser.add_argument("--kinds", nargs="+", default=[])
    parser.add_argument("--kernels", action="store_true")
    parser.add_argument("--blame", action="store_true")
    parser.add_argument("--unread", action="store_true")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
