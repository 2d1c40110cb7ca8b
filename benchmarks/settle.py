"""How many model files of a folder start as they are, and settled: two steps of each on one rung.

    python benchmarks/settle.py FOLDER

FOLDER holds MJCF and URDF files in any depth, as packages of robots bring them. Only files that MuJoCo loads,
once files that they name by package are found, and in which something can move count. Prints one line per
file that does not start, and the sums. Meshes stand for their convex hulls.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import rungwise as rw
from rungwise.scene.space.mujoco_model import compiled, read_spec

LIMIT = 30.0
"""Seconds for one file."""


def outcome(path: Path, settle: bool) -> tuple[str, str]:
    """What two steps on dynamic-compliant come to, and why; "refused" where the scene is not read."""
    try:
        model = {"file": str(path.resolve()), "meshes": {"*": "hull"}}
        scene = rw.load({"name": "model", "model": model}, settle=settle)
        step = float(scene.bind().model.opt.timestep)
        run = rw.simulate(scene, "dynamic-compliant", duration=2.0 * step, limit=LIMIT)
    except rw.InputError as error:
        return ("invalid" if str(error).startswith("start") else "refused"), str(error)
    return str(run.outcome), run.reason


def loads(path: Path) -> bool:
    """Whether MuJoCo loads a file, and something can move in it."""
    try:
        return bool(compiled(read_spec(path), path).nv)
    except rw.SceneError:
        return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    files = sorted(p for p in parser.parse_args().folder.rglob("*") if p.suffix in (".xml", ".urdf"))
    before, after = Counter[str](), Counter[str]()
    for path in filter(loads, files):
        here, _ = outcome(path, False)
        there, why = outcome(path, True) if here == "invalid" else (here, "")
        before[here] += 1
        after[there] += 1
        if there in ("invalid", "jammed", "not_converged"):
            print(f"{path.name}: {there}: {why[:150]}")
    print(f"as they are: {dict(before)}")
    print(f"settled: {dict(after)}")


if __name__ == "__main__":
    main()
