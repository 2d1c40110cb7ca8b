"""Numbers that are free by a factor: all changed at once, and which runs of the shipped scenes notice.

    python benchmarks/decades.py [SCENE ...]

`docs/constants.txt` calls a number free by a factor where no answer is known to hang on it within that
factor, to either side. Here the numbers free by each factor are all multiplied by it in a copy of the
package, then divided, and the planar scenes that ship, and some in space, are run on each rung that moves. A
run notices where its outcome is another, or it ends farther away than a twentieth of its way. Each copy
compiles its kernels anew, which takes minutes. Exit code 1 where more than one run in fifty notices.
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
NOTICED, ALLOWED = 0.05, 0.02
"""Distance of ends, over the way, that counts; and the part of the runs that may notice."""
SPACE = ("ball", "peg", "slope", "stack", "three_finger_lift", "three_fingers")
Ends = dict[tuple[str, str], tuple[str, list[float], float]]

RUN = """
import json, sys
import numpy as np
import rungwise as rw
for scene in sys.argv[1:]:
    for rung in (each for each in rw.LADDER if each.moves):
        run = rw.simulate(scene, rung)
        places = run.trajectory.position.values
        print(json.dumps([scene, rung.name, run.outcome.name, places[-1].tolist(), float(np.ptp(places))]))
"""


def free() -> dict[float, set[tuple[str, str]]]:
    """The numbers, as (file, name), by the factor within which they are free."""
    spec = importlib.util.spec_from_file_location("constants", ROOT / "docs/constants.py")
    assert spec is not None and spec.loader is not None
    constants = importlib.util.module_from_spec(spec)
    sys.modules["constants"] = constants
    spec.loader.exec_module(constants)
    found: dict[float, set[tuple[str, str]]] = {}
    for entry in constants.entries():
        if entry.free and entry.kind != "search":  # those are for `search_numbers.py`
            found.setdefault(entry.free, set()).update((entry.file, name) for name in entry.names)
    return found


def changed(text: str, names: Collection[str], factor: float) -> str:
    """A module's text with these of its numbers times the factor, whole numbers rounded and at least 1."""
    lines, after = text.split("\n"), dict[int, list[str]]()
    for statement in ast.parse(text).body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None:
            target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
            for part in ast.walk(target):
                if isinstance(part, ast.Name) and part.id in names:
                    new = f"max(1, round({part.id} * {factor})) if isinstance({part.id}, int) else"
                    line = f"{part.id} = {new} {part.id} * {factor}"
                    after.setdefault(statement.end_lineno or 0, []).append(line)
    assert sum(map(len, after.values())) == len(names), names
    for at in sorted(after, reverse=True):
        lines[at:at] = after[at]
    return "\n".join(lines)


def ends(package: Path, scenes: Sequence[str], cache: Path | None = None) -> Ends:
    """Outcome, last places and way of each run, with the package that is in this folder."""
    own = {} if cache is None else {"RUNGWISE_CACHE": str(cache)}
    environment = os.environ | {"PYTHONPATH": str(package)} | own
    command = [sys.executable, "-c", RUN, *scenes]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True, cwd=package)
    rows: list[list[Any]] = [json.loads(line) for line in done.stdout.splitlines()]
    return {(scene, rung): (outcome, places, way) for scene, rung, outcome, places, way in rows}


def notices(before: Ends, after: Ends) -> list[str]:
    """The runs that notice a change, in words."""
    lines = []
    for (scene, rung), (outcome, places, way) in before.items():
        other, others, _ = after[scene, rung]
        far = max(abs(a - b) for a, b in zip(places, others, strict=True))
        if other != outcome or far > NOTICED * way:
            lines.append(f"{scene} on {rung}: {outcome} -> {other}, {far / (way or 1.0):.2g} of its way off")
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scenes", nargs="*")
    scenes = parser.parse_args(arguments).scenes
    planar = sorted(file.stem for file in (ROOT / "src/rungwise/scene/library").glob("*.yaml"))
    scenes = scenes or [*planar, *SPACE]
    before, most = ends(ROOT / "src", scenes), 0.0
    for factor, numbers in sorted(free().items()):
        for by in (1.0 / factor, factor):
            with tempfile.TemporaryDirectory() as folder:
                package = Path(folder) / "src"
                shutil.copytree(ROOT / "src", package, ignore=shutil.ignore_patterns("__pycache__"))
                for file in {file for file, _ in numbers}:
                    at = package / "rungwise" / file
                    names = {name for own, name in numbers if own == file}
                    at.write_text(changed(at.read_text("utf-8"), names, by), "utf-8")
                found = notices(before, ends(package, scenes, Path(folder) / "cache"))
            most = max(most, len(found) / len(before))
            print(
                f"{len(numbers)} numbers times {by:g}: {len(found)} of {len(before)} runs notice", flush=True
            )
            print(*(f"  {line}" for line in found), sep="\n", end="\n" if found else "")
    return int(most > ALLOWED)


if __name__ == "__main__":
    raise SystemExit(main())
