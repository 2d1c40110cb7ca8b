"""Motions of real objects: every dynamic rung and other simulators, fitted and scored by the same code.

    python benchmarks/real.py FOLDER [--only tosses squares ellipses push] [--trials N] [--seed N]
    [--json FILE]
    python benchmarks/real.py FOLDER --seeds N

FOLDER holds the published sets as arrays (`tosses.npz`, `squares.npz`, `ellipses.npz`, `push.npz`; sources
and licences in docs/real.md). Half of N trials are fitted, the others held out: by spans of a quarter of a
trial or less, and, in the last columns, by whole trials. Errors are means over the trials held out, with 95 %
intervals (bootstrap over trials). With --seeds, `dynamic-rigid` alone is fitted to all N trials with so many
seeds, which choose other spans, samples and draws: whether the intervals agree. An engine that is not
installed is left out (`pip install .[race]` has them all). The push is told in benchmarks/real_push.py.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import real_peers as peers  # beside this file
import real_push  # beside this file

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.score import Mean, by_trial, mean_of, sizes
from rungwise.fitting.stages import Search
from rungwise.kernel import Reals

DATA = Path(__file__).parent.parent / "examples" / "data"
RIGID, COMPLIANT = "dynamic-rigid", "dynamic-compliant"
FRAMES = 148.0
"""Frames a second of the tosses."""
AFTER = 5e-3
"""Seconds after an impact of an ellipse by which its velocity is compared: short enough for no other one."""
HALF_AXES = (0.035, 0.025)
GYRATION = 0.0192
"""Radius of gyration (m) of the ellipse. A uniform one would have 0.0215, but changes of velocity in the set
say 0.0185 to 0.0196 (`benchmarks/impacts.py` prints them)."""


@dataclass(frozen=True)
class Real:
    """Measured motions of one object: scene, motions, size (m) by which errors of place are divided, what
    each rung is fitted over, and makers of other engines."""

    name: str
    scene: Any
    motions: rw.Motions
    size: float
    over: dict[str, tuple[str, ...]]
    engines: dict[str, Callable[[], Any]] = field(default_factory=dict)
    span: float | None = None
    step: float | None = None


@dataclass(frozen=True)
class Line:
    """What one engine makes of one set."""

    data: str
    engine: str
    values: dict[str, float]
    place: Mean
    turn: Mean
    place_whole: Mean
    turn_whole: Mean
    wall_s: float


def tosses(folder: Path, trials: int) -> Real:
    """Tosses of a cube (Pfrommer, Halm, Posa 2020)."""
    kept = np.load(folder / "tosses.npz")
    every = [kept[name] for name in kept.files[:trials]]
    scene = peers.with_parameters(DATA / "cube_toss.yaml")
    motions = rw.Motions(
        scene.template.coordinates, [np.arange(len(x)) / FRAMES for x in every],
        [np.hstack([x[:, 4:7], x[:, :4]]) for x in every],
        [np.hstack([x[:, 10:13], x[:, 7:10]]) for x in every],
        rates=[f"cube.{name}" for name in ("x", "y", "z", "rx", "ry", "rz")],
    )  # fmt: skip
    over = {RIGID: ("mu", "e"), COMPLIANT: ("mu", "K", "C"), "mujoco": SOLREF}
    file = str(DATA / "cube_toss.xml")
    return Real(
        "tosses",
        scene,
        motions,
        0.1048,
        over,
        {"mujoco": lambda: peers.mujoco_space(file)},
        step=0.5 / FRAMES,
    )


def squares(folder: Path, trials: int) -> Real:
    """Drops of a square in a vertical plane (Fazeli and others 2017)."""
    kept = np.load(folder / "squares.npz")
    every = [kept[name] for name in kept.files[:trials]]
    scene = peers.with_parameters(DATA / "square_drop.yaml")
    motions = rw.Motions(
        scene.template.coordinates, 0.004 * np.arange(len(every[0])), [x[:, :3] for x in every],
        [x[:, 3:] for x in every],
    )  # fmt: skip
    side = 0.03
    corners = np.array([(-side, -side), (side, -side), (side, side), (-side, side)])
    return Real("squares", scene, motions, 0.06, _planar(), _engines(peers.Outline(corners, 6e-4, "table")))


def ellipses(folder: Path, trials: int) -> Real:
    """Single impacts of an ellipse (Fazeli and others 2017): velocities after, from those before."""
    kept = np.load(folder / "ellipses.npz")
    rows = kept["states"][~kept["flags"].astype(bool).any(axis=1)][:trials].copy()
    rows[:, [2, 5, 8, 11]] *= -1.0  # clockwise in this set: otherwise impulses do not fit the change of spin
    turns = 2.0 * math.pi * np.arange(96) / 96
    corners = np.column_stack([HALF_AXES[0] * np.cos(turns), HALF_AXES[1] * np.sin(turns)])
    return impacts("ellipses", corners, GYRATION**2, rows[:, :6], rows[:, 9:])


def impacts(name: str, corners: Reals, inertia: float, before: Reals, after: Reals) -> Real:
    """Single impacts of a part with these corners (k, 2), and this inertia over mass, on a table at y = 0:
    velocities after (n, 3), from places and velocities before (n, 6)."""
    before = before.copy()
    before[:, 1] = np.max(
        -(np.sin(before[:, 2:3]) * corners[:, 0] + np.cos(before[:, 2:3]) * corners[:, 1]), axis=1
    )
    since = AFTER * np.arange(3) / 2.0
    places = before[:, None, :3] + after[:, None] * since[:, None]
    places[..., 1] -= 0.5 * peers.GRAVITY * since**2
    speeds = np.concatenate([before[:, None, 3:], np.repeat(after[:, None], 2, axis=1)], axis=1)
    data = dict(rw.load(DATA / "square_drop.yaml").file.model_dump(mode="json", exclude_unset=True))
    shape = {"kind": "polygon", "vertices": corners.tolist()}
    part = data["bodies"].pop("square") | {"shape": shape, "inertia": f"mass * {inertia}"}
    table = data["bodies"]["table"] | {"pose": {"y": 0.0}}
    data |= {"name": "impact", "bodies": {"part": part, "table": table}}
    data["contacts"] = [data["contacts"][0] | {"between": ["part", "table"]}]
    scene = rw.load(data | {"parameters": data["parameters"] | peers.PARAMETERS})
    known = {"x": 0.02 * AFTER, "y": 0.02 * AFTER, "angle": 0.5 * AFTER}
    known = {f"part.{each}": x for each, x in known.items()} | {
        "speed(part.x)": 0.02, "speed(part.y)": 0.02, "speed(part.angle)": 0.5,
    }  # fmt: skip
    motions = rw.Motions(scene.template.coordinates, since, places, speeds, deviations=known)
    made = _engines(peers.Outline(corners, inertia))
    engines = {each: make for each, make in made.items() if each != "box2d"}
    return Real(name, scene, motions, AFTER, _planar(), engines, math.inf)


SOLREF = ("friction", "time_constant", "damping_ratio")


def _planar() -> dict[str, tuple[str, ...]]:
    bounce = ("friction", "bounce")
    return {
        RIGID: ("mu", "e"), COMPLIANT: ("mu", "K", "C"), "mujoco": SOLREF, "box2d": bounce, "pymunk": bounce,
    }  # fmt: skip


def _engines(part: peers.Outline) -> dict[str, Callable[[], Any]]:
    made = {"mujoco": peers.mujoco_plane, "box2d": peers.box2d, "pymunk": peers.pymunk}
    modules = {"mujoco": "mujoco", "box2d": "Box2D", "pymunk": "pymunk"}
    return {name: (lambda m=make: m(part)) for name, make in made.items() if find_spec(modules[name])}


SETS = {"tosses": tosses, "squares": squares, "ellipses": ellipses}


def measured(real: Real, seed: int) -> list[Line]:
    """All engines on one set."""
    train, test = real.motions.split(0.5, seed=seed)
    return [_line(real, name, train, test, seed) for name in (RIGID, COMPLIANT, *real.engines)]


def _line(real: Real, name: str, train: rw.Motions, test: rw.Motions, seed: int) -> Line:
    """One engine, fitted on some trials and scored on others."""
    fit = fitted(real, name, train, seed)
    whole = [errors_of(real, name, fit.values, test, span) for span in dict.fromkeys((real.span, math.inf))]
    errors = [mean_of(each) for pair in whole for each in pair]
    return Line(real.name, name, fit.values, *(errors * 2)[:4], wall_s=fit.wall_s)


def fitted(real: Real, name: str, train: rw.Motions, seed: int) -> Any:
    """An engine fitted to trials."""
    return Search(_prepared(real, name, train, real.span, seed), NEVER, None).found()


def errors_of(
    real: Real, name: str, values: dict[str, float], test: rw.Motions, span: float | None
) -> list[Reals]:
    """Errors (trials,) of place and of turn of an engine at these values; of velocity after impacts."""
    one = _prepared(real, name, test, span, 0)
    runs = one.predictor(one.spans(), NEVER)
    point = np.array([values[each] for each in runs.over])
    found = sizes(one.scene, one.layout.compared, runs(point[None]).errors[0])
    if real.size == AFTER:
        found = type(found)(*(each[:, -1:] / AFTER * np.ones_like(each) for each in found))
    return [by_trial(runs.spans, each) for each in found[:2]]


def _prepared(real: Real, name: str, motions: rw.Motions, span: float | None, seed: int) -> Any:
    """An engine and trials, ready to be fitted."""
    options = Options(span, 10, real.step, None, None, seed)
    rung = rw.DYNAMIC_COMPLIANT if name == COMPLIANT else rw.DYNAMIC_RIGID
    own = prepare(real.scene, rung, motions, real.over[name], None, None, options)
    return peers.with_peer(own, real.engines[name]()) if name in real.engines else own


def table(lines: list[Line]) -> str:
    """Lines of a page."""
    found = [
        "| set | engine | parameters | place | turn, rad | place, whole | turn, whole |",
        "|" + "---|" * 7,
    ]
    for line in lines:
        values = ", ".join(f"{name} {value:.3g}" for name, value in line.values.items())
        unit = "m/s" if line.data == "ellipses" else "mm"
        scale = 1.0 if line.data == "ellipses" else 1e3
        places = [_shown(each, scale) + f" {unit}" for each in (line.place, line.place_whole)]
        turns = [_shown(each) for each in (line.turn, line.turn_whole)]
        cells = (line.data, line.engine, values, places[0], turns[0], places[1], turns[1])
        found.append("| " + " | ".join(cells) + " |")
    return "\n".join(found)


def _shown(mean: Mean, scale: float = 1.0) -> str:
    return f"{mean.value * scale:.3g} ({mean.lower * scale:.3g} to {mean.upper * scale:.3g})"


def repeated(real: Real, seeds: int) -> str:
    """Lines of a page: values and intervals by seed."""
    over, found = real.over[RIGID], []
    for seed in range(seeds):
        own = rw.fit(real.scene, RIGID, real.motions, over, span=real.span, step=real.step, seed=seed)
        values = [
            f"{own.values[n]:.3f} ({low:.3f} to {high:.3f})" for n, (low, high) in own.intervals.items()
        ]
        found.append((real.name, seed, *values, len(own.alike) or 1, f"{own.wall_s:.0f}"))
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=(*SETS, "push"), default=[*SETS, "push"])
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=int)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if given.seeds is not None:
        print("| set | seed | mu | e | minima | s |\n|" + "---|" * 6)
        for name in (each for each in given.only if each in SETS):
            print(repeated(SETS[name](given.folder, given.trials), given.seeds), flush=True)
        return
    lines: list[Line] = []
    for name in given.only:
        if name == "push":
            real_push.table(given.folder, given.seed)
            continue
        lines += measured(SETS[name](given.folder, given.trials), given.seed)
        print(table([line for line in lines if line.data == name]), flush=True)
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(line) for line in lines], indent=1))


if __name__ == "__main__":
    main()
