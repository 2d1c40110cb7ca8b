"""Bodies in space that have to rest, on every rung with forces, at many lengths of steps and errors allowed.

    python benchmarks/rests.py [--kinds pinch,across,...] [--every 1] [--processes 2]

Prints one line per run that is wrong, and for each kind how many runs there were, how many ended otherwise
than by time, how many moved, and how many took a fifth more than their nominal steps. `--every` takes every
k-th run only. The runs are those of

- pinch: a part between two pads that servos press, four kinds of pads and nine of parts;
- across: a body that overhangs what it lies on;
- lies: a shape at rest on a height field, level and gently sloped;
- falls: a shape let fall onto one, which has to be at rest a second later;
- leans: a box and a capsule with torsion let fall beside each other, at many poses;
- reaches: an arm led through free air beside a cube at rest;
- lifts: a gripper that closes on a part, lifts it and carries it away.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.simulation.spatial.result import SpaceRun

LIES = 'euler="90 0 0"'
FORCES = tuple(rung.name for rung in rw.LADDER if rung.moves and rung.loads)
DYNAMIC = tuple(rung.name for rung in rw.LADDER if rung.inertia > 0.0)
STEPS = (1e-4, 3e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2)
TOLS = (None, 1e-5)
MOVED = 2e-4
"""Motion that counts (m, and of quaternions): contacts of compliant rungs yield by less."""
SLOW = 1.2
"""Steps over nominal ones that count as many."""
LIMIT = 60.0
"""Seconds for one run."""


@dataclass(frozen=True)
class Case:
    """A scene, how it is run, and whether it has to be as it was at its start (`still`) or at rest in the
    last tenth."""

    kind: str
    name: str
    model: str
    rung: str
    step: float
    tol: float | None
    duration: float
    still: bool = True
    fields: dict[str, Any] = field(default_factory=dict)


def pinch() -> Iterator[Case]:
    """Friction carries twenty times the weight; pads are shorter than the part."""
    pads = {
        "box": ('type="box" size=".01 .02 .02"', 0.01),
        "capsule": (f'type="capsule" size=".01 .02" {LIES}', 0.01),
        "cylinder": (f'type="cylinder" size=".01 .02" {LIES}', 0.01),
        "sphere": ('size=".01"', 0.01),
    }
    parts = {
        "sphere": ('size=".01"', 0.01),
        "capsule": (f'type="capsule" size=".01 .03" {LIES}', 0.01),
        "upright capsule": ('type="capsule" size=".01 .03"', 0.01),
        "cylinder": (f'type="cylinder" size=".01 .03" {LIES}', 0.01),
        "upright cylinder": ('type="cylinder" size=".01 .03"', 0.01),
        "ends": ('type="cylinder" size=".02 .01" euler="0 90 0"', 0.01),
        "ellipsoid": ('type="ellipsoid" size=".01 .02 .015"', 0.01),
        "box": ('type="box" size=".01 .03 .02"', 0.01),
        "mesh": ('type="mesh" mesh="prism"', 0.01),
    }
    corners = [(x, *at) for x in (-0.01, 0.01) for at in ((-0.03, -0.02), (0.03, -0.02), (0.0, 0.04))]
    numbers = " ".join(f"{value}" for corner in corners for value in corner)
    mesh = f'<asset><mesh name="prism" vertex="{numbers}" inertia="convex"/></asset>'
    for (pad, (geom, wide)), (part, (own, half)) in product(pads.items(), parts.items()):
        jaws = "".join(
            f'<body name="{name}" pos="{-sign * (wide + half)} 0 .2"><joint name="{name}" type="slide"'
            f' axis="{sign} 0 0"/><geom {geom} mass=".1" friction=".7"/></body>'
            for name, sign in (("l", 1), ("r", -1))
        )
        held = f'<body name="part" pos="0 0 .2"><freejoint/><geom {own} mass=".0428" friction=".7"/></body>'
        servos = "".join(f'<position name="a{name}" joint="{name}" kp="2000" kv="20"/>' for name in "lr")
        model = f"{mesh}<worldbody>{jaws}{held}</worldbody><actuator>{servos}</actuator>"
        for rung, step, tol in product(FORCES, STEPS, TOLS):
            fields = {"controls": {"al": 0.003, "ar": 0.003}}
            yield Case(
                "pinch", f"{part} in {pad}s", model, rung, step, tol, max(0.05, 20 * step), fields=fields
            )


def across() -> Iterator[Case]:
    """A body that overhangs what it lies on."""
    pedestal = '<geom type="box" size=".02 .02 .02" pos="0 0 .02"/>'
    boxes = "".join(f'<geom type="box" size=".02 .02 .02" pos="0 {y} .02"/>' for y in (-0.05, 0.05))

    def rails(kind: str, x: float) -> str:
        return "".join(f'<geom type="{kind}" size=".01 .05" pos="{p} 0 .01" {LIES}/>' for p in (-x, x))

    scenes = {
        "capsule on a pedestal": (pedestal, f'type="capsule" size=".01 .05" {LIES}', 0.05),
        "thin capsule on a pedestal": (pedestal, f'type="capsule" size=".004 .06" {LIES}', 0.044),
        "skew capsule on a pedestal": (pedestal, 'type="capsule" size=".01 .05" euler="90 0 33"', 0.05),
        "cylinder on a pedestal": (pedestal, f'type="cylinder" size=".01 .05" {LIES}', 0.05),
        "capsule on two boxes": (boxes, f'type="capsule" size=".01 .08" {LIES}', 0.05),
        "skew capsule on two boxes": (boxes, 'type="capsule" size=".01 .08" euler="90 0 9"', 0.05),
        "plate on capsules": (rails("capsule", 0.03), 'type="box" size=".05 .04 .005"', 0.025),
        "long plate on capsules": (rails("capsule", 0.02), 'type="box" size=".06 .08 .005"', 0.025),
        "plate on cylinders": (rails("cylinder", 0.03), 'type="box" size=".05 .04 .005"', 0.025),
        "capsule across rails": (
            rails("capsule", 0.03), 'type="capsule" size=".01 .05" euler="0 90 0"', 0.03,
        ),
        "skew plate on capsules": (
            rails("capsule", 0.03), 'type="box" size=".05 .04 .005" euler="0 0 17"', 0.025,
        ),
    }  # fmt: skip
    for name, (below, geom, height) in scenes.items():
        lying = f'<freejoint/><geom {geom} mass=".1" friction=".7"/>'
        body = f'<body name="b" pos="0 0 {height:.12f}">{lying}</body>'
        model = f"<worldbody>{below}{body}</worldbody>"
        for rung, step, tol in product(FORCES, STEPS, TOLS):
            yield Case("across", name, model, rung, step, tol, max(0.05, 20 * step))


ROLLS = 'condim="6" friction=".7 .01 .01"'
SHAPES = {
    "box": ('type="box" size=".03 .02 .02" friction=".7"', 0.02),
    "ball": (f'size=".02" {ROLLS}', 0.02),
    "can": ('type="cylinder" size=".02 .02" friction=".7"', 0.02),
    "capsule": (f'type="capsule" size=".02 .03" {LIES} {ROLLS}', 0.02),
    "egg": (f'type="ellipsoid" size=".03 .03 .02" {ROLLS}', 0.02),
    "mesh": ('type="mesh" mesh="prism" friction=".7"', 0.02),
}
PRISM = [(x, y, z) for z in (-0.02, 0.02) for x, y in ((-0.04, -0.02), (0.04, -0.02), (0.0, 0.04))]
SLOPES = {"level": (0.0, 0.0), "along x": (0.1, 0.0), "across": (0.05, 0.08)}
"""Slopes of a field along x and y."""
GRID, HALF, DEEP = 21, 0.2, 0.1


def ground(along: float, aside: float) -> tuple[str, float]:
    """A height field with these slopes, and where it lies so that it is at 0 in the middle."""
    at = np.linspace(-HALF, HALF, GRID)
    heights = 0.5 * DEEP + along * at[None, :] + aside * at[:, None]
    low = float(heights.min())
    span = float(np.ptp(heights)) or DEEP
    # MJCF begins with the row of the greatest y.
    numbers = " ".join(f"{value:.15g}" for value in ((heights - low) / span)[::-1].ravel())
    mesh = " ".join(f"{value}" for corner in PRISM for value in corner)
    return (
        f'<asset><mesh name="prism" vertex="{mesh}" inertia="convex"/><hfield name="h" nrow="{GRID}"'
        f' ncol="{GRID}" size="{HALF} {HALF} {span} .05" elevation="{numbers}"/></asset>'
    ), low - 0.5 * DEEP


def on_field(geom: str, above: float, along: float, aside: float, spin: float = 0.0) -> str:
    """A model of a shape with its face along a sloped field, so far above it."""
    asset, low = ground(along, aside)
    normal = np.array([-along, -aside, 1.0]) / np.linalg.norm([along, aside, 1.0])
    x, y = 0.013, 0.007
    place = np.array([x, y, along * x + aside * y]) + above * normal
    first = np.array([np.cos(spin), np.sin(spin), 0.0])
    first -= normal * (normal @ first)
    first /= np.linalg.norm(first)
    axes = " ".join(f"{value:.15g}" for value in (*first, *np.cross(normal, first)))
    at = " ".join(f"{value:.15g}" for value in place)
    body = f'<body name="b" pos="{at}" xyaxes="{axes}"><freejoint/><geom mass=".1" {geom}/></body>'
    field_geom = f'<geom type="hfield" hfield="h" friction=".7" pos="0 0 {low:.15g}"/>'
    return f"{asset}<worldbody>{field_geom}{body}</worldbody>"


def lies() -> Iterator[Case]:
    for (name, (geom, half)), (slope, angles), spin in product(SHAPES.items(), SLOPES.items(), (0.0, 0.4)):
        if name == "egg" and any(angles):
            continue  # it rolls until its weight stands above its contact
        for rung, step, tol in product(FORCES, STEPS, TOLS):
            yield Case(
                "lies", f"{name} {slope} {spin}", on_field(geom, half, *angles, spin), rung, step, tol,
                max(0.05, 20 * step),
            )  # fmt: skip


def falls() -> Iterator[Case]:
    for (name, (geom, half)), (slope, angles) in product(SHAPES.items(), SLOPES.items()):
        if name == "ball" and slope == "level":
            geom = 'size=".02" friction=".7"'
        if name == "egg":
            continue  # it rocks
        model = on_field(geom, half + 0.02, *angles, 0.4)
        for rung, step, tol in product(DYNAMIC, STEPS[2:], TOLS):
            yield Case("falls", f"{name} {slope}", model, rung, step, tol, 1.0, still=False)


def leans() -> Iterator[Case]:
    rng = np.random.default_rng(0)
    for number in range(12):
        turns = [" ".join(f"{value:.4f}" for value in rng.normal(size=4)) for _ in range(2)]
        x, y = rng.uniform(-0.03, 0.03, 2), rng.uniform(-0.03, 0.03, 2)
        r, half, *sides = rng.uniform(0.015, 0.03), rng.uniform(0.03, 0.06), *rng.uniform(0.03, 0.09, 3)
        dim = (3, 4, 6)[number % 3]
        law = f'condim="{dim}" friction="{rng.uniform(0.3, 0.8):.3f} .01 .001"'
        model = (
            '<worldbody><geom type="box" size="1 1 .02" pos="0 0 -.02"/>'
            f'<body name="a" pos="{x[0]} {y[0]} .15" quat="{turns[0]}"><freejoint/><geom type="capsule"'
            f' size="{r} {half}" density="700" {law}/></body>'
            f'<body name="b" pos="{x[1]} {y[1]} .4" quat="{turns[1]}"><freejoint/><geom type="box"'
            f' size="{sides[0]} {sides[1]} {sides[2]}" density="700" {law}/></body></worldbody>'
        )
        for rung, step, tol in product(DYNAMIC, (5e-4, 1e-3, 1.7e-3, 2e-3, 2.5e-3, 3.1e-3, 4e-3, 5e-3), TOLS):
            # Whether they roll on is the law's to say: the run has to go through.
            yield Case("leans", f"{number}", model, rung, step, tol, 1.0, still=False, fields={"rolls": True})


def reaches() -> Iterator[Case]:
    """An arm of three joints that servos or speeds lead through free air, beside a cube on a table."""
    links = ((2.0, 0.03, "0 0 0 .3 0 .2", "0 0 .3", "0 0 1"),
             (1.0, 0.025, "0 0 0 .3 0 0", ".3 0 .2", "0 1 0"),
             (0.5, 0.02, "0 0 0 .15 0 -.1", ".3 0 0", "0 1 0"))  # fmt: skip
    arm = "".join(
        f'<body name="l{k}" pos="{at}"><joint name="j{k}" axis="{axis}"/><geom type="capsule" size="{thick}"'
        f' fromto="{ends}" mass="{mass}" contype="{2 ** (k + 1)}" conaffinity="1"/>'
        for k, (mass, thick, ends, at, axis) in enumerate(links)
    ) + "</body>" * len(links)
    drives = {
        "servos": '<position joint="j{k}" name="a{k}" kp="4000" kv="150"/>',
        "weak servos": '<position joint="j{k}" name="a{k}" kp="500" kv="12" forcerange="-87 87"/>',
        "speeds": '<velocity joint="j{k}" name="a{k}" kv="500"/>',
    }
    table = '<geom type="box" size=".5 .5 .02" pos=".6 0 -.02"/>'
    speeds = (1.0, 0.2, -0.5)
    for (name, drive), half in product(drives.items(), (0.0, 0.002, 0.005, 0.01, 0.025)):
        cube = (
            f'<body name="cube" pos=".6 .3 {half}"><freejoint/><geom type="box" size="{half} {half} {half}"'
            ' density="1000" friction=".7"/></body>'
            if half
            else ""
        )
        motors = "".join(drive.format(k=k) for k in range(len(links)))
        told = {f"a{k}": v if name == "speeds" else f"{v} * t" for k, v in enumerate(speeds)}
        model = f"<worldbody>{table}{cube}{arm}</worldbody><actuator>{motors}</actuator>"
        for rung, step in product(FORCES, (1e-3, 2e-3, 5e-3, 1e-2)):
            yield Case(
                "reaches", f"{name} cube {half}", model, rung, step, None, 0.3, still=False,
                fields={"controls": told, "rolls": True},
            )  # fmt: skip


def lifts() -> Iterator[Case]:
    """A gripper on a carriage closes on a part that lies on a table, lifts it and carries it away."""
    table = '<geom type="box" size=".5 .5 .02" pos="0 0 -.02"/>'
    for half, force, kind in product((0.005, 0.015), (20.0, 87.0), ("box", "cylinder")):
        sizes = f"{half} {half} {half}" if kind == "box" else f"{half} {half}"
        cube = (
            f'<body name="cube" pos="0 0 {half}"><freejoint/><geom type="{kind}" size="{sizes}" density="800"'
            ' friction=".8"/></body>'
        )
        jaws = "".join(
            f'<body name="{name}" pos="{-sign * (half + 0.01)} 0 0"><joint name="{name}" type="slide"'
            f' axis="{sign} 0 0"/><geom type="box" size=".004 .01 .02" mass=".05" friction=".8"/></body>'
            for name, sign in (("l", 1), ("r", -1))
        )
        hand = (
            f'<body name="hand" pos="0 0 {max(half, 0.021) + 1e-3}">'
            f'<joint name="z" type="slide" axis="0 0 1"/>'
            f'<joint name="x" type="slide" axis="1 0 0"/>'
            f'<geom type="box" size=".02 .02 .01" pos="0 0 .06" mass=".5"/>{jaws}</body>'
        )
        servos = "".join(
            f'<position name="a{name}" joint="{name}" kp="2000" kv="{kv}" forcerange="{-force} {force}"/>'
            for name, kv in (("l", 20), ("r", 20), ("z", 150), ("x", 150))
        )
        model = f"<worldbody>{table}{cube}{hand}</worldbody><actuator>{servos}</actuator>"
        told = {
            "al": "min(0.04 * t, 0.01)", "ar": "min(0.04 * t, 0.01)",
            "az": "min(max(0.0, 0.2 * (t - 0.4)), 0.1)", "ax": "max(0.0, 0.3 * (t - 0.8))",
        }  # fmt: skip
        for rung, step in product(FORCES, (1e-3, 2e-3, 5e-3)):
            yield Case(
                "lifts", f"{kind} {half} by {force:g} N", model, rung, step, None, 1.2, still=False,
                fields={"controls": told, "rolls": True},
            )  # fmt: skip


KINDS = {
    "pinch": pinch, "across": across, "lies": lies, "falls": falls, "leans": leans, "reaches": reaches,
    "lifts": lifts,
}  # fmt: skip


def wrong(case: Case) -> tuple[Case, str, str, float]:
    """What is wrong with a run in a word, or "", with figures, and its seconds."""
    began = time.perf_counter()
    fields = {key: value for key, value in case.fields.items() if key != "rolls"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.xml"
        path.write_text(f"<mujoco>{case.model}</mujoco>")
        run = rw.simulate(
            rw.load({"name": case.kind, "model": {"file": str(path)}, **fields}), case.rung, step=case.step,
            tol=case.tol, duration=case.duration, limit=LIMIT, stride=1, frames=10**6,
        )  # fmt: skip
    assert isinstance(run, SpaceRun)
    took = time.perf_counter() - began
    if run.outcome != "timeout" or run.time < case.duration * (1.0 - 1e-9):
        return case, "ends", f"{run.outcome} at {run.time:.4g}: {run.reason[:110]}", took
    late = [each for each in run.frames if each.time >= 0.9 * case.duration]
    before = run.frames[0] if case.still else late[0]
    moved = max(float(np.abs(each.q - before.q).max()) for each in run.frames if case.still or each in late)
    if moved > MOVED and "rolls" not in case.fields:
        return case, "moves", f"{moved:.3g}", took
    if case.tol is None and run.steps > SLOW * case.duration / case.step:
        return case, "slow", f"{run.steps} steps for {case.duration / case.step:.0f}", took
    return case, "", "", took


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args()
    cases = [
        case for kind in chosen.kinds.split(",") for case in islice(KINDS[kind](), 0, None, chosen.every)
    ]
    counts: dict[str, Counter[str]] = {}
    with get_context("spawn").Pool(chosen.processes) as pool:
        for case, word, figures, took in pool.imap(wrong, cases, chunksize=8):
            count = counts.setdefault(case.kind, Counter())
            count["runs"] += 1
            if word:
                count[word] += 1
                print(
                    f"{case.kind}: {case.name}: {case.rung} h {case.step:g} tol {case.tol}: {word} {figures}"
                    f" ({took:.1f} s)",
                    flush=True,
                )
    print(f"{'kind':8}{'runs':>6}{'ends':>6}{'moves':>6}{'slow':>6}")
    for kind, count in counts.items():
        print(f"{kind:8}" + "".join(f"{count[word]:6}" for word in ("runs", "ends", "moves", "slow")))


if __name__ == "__main__":
    main()
