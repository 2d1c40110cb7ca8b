"""The measured push of benchmarks/real.py: every rung with forces, and other simulators, on one push.

A steel hexagon on plywood is pushed by a rod (Yu, Bauza, Fazeli, Rodriguez 2016). The rod is at the end of
an arm that moves as measured, and yields: by the record the rod would be up to 1.2 mm inside the part. Runs
begin at rest before the push, and last to its end. Every other window of `WINDOW` frames is fitted, and the
run is scored in the others; then the other way round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import push_peers  # beside this file
import real_peers

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.score import Mean, mean_of
from rungwise.fitting.stages import Search
from rungwise.kernel import Reals

SIDE, ROD, THICK, DENSITY = 0.0605, 0.00475, 0.013, 8000.0
"""Side of the hexagon, radius of the rod, thickness (m); density of steel (kg/m^3)."""
MASS = DENSITY * THICK * 1.5 * math.sqrt(3.0) * SIDE**2
CORNERS = SIDE * np.array([(math.cos(x), math.sin(x)) for x in np.arange(6) * math.pi / 3.0])
FIRST, LAST, PERIOD = 0.14, 0.56, 0.004
"""Part of the record that is compared, and time between its frames (s)."""
WINDOW = 9
"""Frames that are fitted, or held out, together."""
DEVIATIONS = (2e-5, 2e-5, 2e-4)
"""Of the measurement: place (m) and angle."""
SUPPORT = ("mu", "mu_s", "press", "centre_x", "centre_y", "arm", "lag")
OVER = {
    "quasistatic-rigid": SUPPORT,
    "quasistatic-compliant": SUPPORT,
    "dynamic-rigid": (*SUPPORT, "arm_C"),
    "dynamic-compliant": (*SUPPORT, "arm_C"),
}
EXACT = ("dynamic-compliant",)
"""Rungs that are fitted with the exact limit surface, too: a step takes twice as long."""
OTHERS = ("mujoco", "box2d", "pymunk")
UNITS = {"arm": (" N/m", 1.0), "arm_C": (" N s/m", 1.0), "lag": (" ms", 1e3)}
UNITS |= dict.fromkeys(("press", "centre_x", "centre_y"), (" mm", 1e3))


@dataclass(frozen=True)
class Push:
    """Frames of the push, at equal intervals: places and speeds of the rod (k, 4), places of the part (k, 3),
    force of the rod on the part (k, 2)."""

    rod: Reals
    part: Reals
    force: Reals

    def motions(self, shown: Any) -> rw.Motions:
        """The motion of the part in the frames that are shown (k,), and at the start."""
        k, part = len(self.part), self.part.copy()
        part[~(shown | (np.arange(k) == 0))] = np.nan
        names = tuple(f"part.{name}" for name in ("x", "y", "angle"))
        known = dict(zip(names, DEVIATIONS, strict=True))
        known |= {f"speed({name})": 50.0 * x for name, x in known.items()}
        inputs = dict(zip(("x", "y", "vx", "vy"), self.rod.T[:, None], strict=True))
        times = PERIOD * np.arange(k)
        return rw.Motions(names, times, [part], [np.zeros_like(part)], inputs=inputs, deviations=known)


def scene_of(surface: str, tip: Reals) -> Any:
    """The hexagon on its support, and the rod at the end of a yielding arm that moves as measured."""
    parameters = {
        "mu": {"default": 0.2, "range": [0.0, 1.0], "about": "friction between rod and part"},
        "mu_s": {"default": 0.3, "range": [0.05, 1.0], "about": "friction between part and table"},
        "press": {"default": 0.037, "range": [0.01, 0.06], "unit": "m", "about": "radius of the pressure"},
        "centre_x": {"default": 0.0, "range": [-0.03, 0.03], "unit": "m", "about": "centre of pressure"},
        "centre_y": {"default": 0.0, "range": [-0.03, 0.03], "unit": "m", "about": "centre of pressure"},
        "arm": {"default": 6e3, "range": [1e3, 1e5], "unit": "N/m", "about": "stiffness of the robot"},
        "arm_C": {"default": 20.0, "range": [1.0, 200.0], "unit": "N*s/m", "about": "damping of the robot"},
        "lag": {
            "default": 0.0,
            "range": [-0.01, 0.01],
            "unit": "s",
            "about": "clock of the part after the rod's",
        },
        "rod": {"default": 0.15, "range": [0.01, 2.0], "unit": "kg", "about": "mass beyond the arm's spring"},
    }
    led = {name: {"default": 0.0, "range": [-10.0, 10.0], "unit": "m"} for name in ("x", "y")}
    led |= {name: {"default": 0.0, "range": [-10.0, 10.0], "unit": "m/s"} for name in ("vx", "vy")}
    servos = [
        {"drive": {"kind": "servo", "stiffness": "arm", "damping": "arm_C", "target": x, "target_speed": v}}
        for x, v in (("x + lag * vx", "vx"), ("y + lag * vy", "vy"))
    ]
    speed = [*servos, {"drive": {"kind": "speed", "speed": 0}}]
    return rw.load({
        "name": "measured_push",
        "parameters": parameters | led,
        "inputs": ["x", "y", "vx", "vy"],
        "bodies": {
            "rod": {
                "role": "robot", "mass": "rod", "shape": {"kind": "disc", "radius": ROD},
                "pose": {"x": float(tip[0]), "y": float(tip[1])}, "motion": {"kind": "free"},
                "coordinates": dict(zip(("x", "y", "angle"), speed, strict=True)),
            },
            "part": {
                "role": "object", "mass": MASS, "motion": {"kind": "free"},
                "shape": {"kind": "polygon", "vertices": CORNERS.tolist()},
                "support": {
                    "friction": "mu_s", "gravity": 9.81, "limit_surface": surface,
                    "pressure": {"kind": "ring", "radius": "press"}, "centre": ["centre_x", "centre_y"],
                },
            },
        },
        "contacts": [{
            "between": ["rod", "part"], "friction": "mu", "stiffness": 1e6, "damping": 200.0,
        }],
        "tolerance": 1e-6, "duration": 1.0, "step": 1e-3,
    })  # fmt: skip


def read(folder: Path) -> Push:
    """The push at equal intervals. Stamps jitter by milliseconds, instruments do not: with frames at equal
    intervals positions scatter a tenth as much."""
    kept = np.load(folder / "push.npz")
    times = np.arange(FIRST, LAST, PERIOD)
    tip, part, wrench = (_even(kept[name], times) for name in ("tip", "object", "wrench"))
    part[:, 2] = np.unwrap(part[:, 2])
    tip = tip[:, :2] + _clear(tip[0, :2], part[0])
    rates = np.gradient(tip, PERIOD, axis=0)
    rates[0] = 0.0
    return Push(np.column_stack([tip, rates]), part, -wrench[:, :2])


def _clear(tip: Reals, part: Reals) -> Reals:
    """How far the rod's frame is off: at rest, without a force, it overlaps the part by 0.07 mm."""
    normal = np.array([-math.sin(part[2]), math.cos(part[2])])
    return normal * max(1e-6 - _gap(tip, part), 0.0)


def _gap(tip: Reals, part: Reals) -> float:
    """Between the rod and the side that it pushes."""
    normal = np.array([-math.sin(part[2]), math.cos(part[2])])
    return float(normal @ (tip - part[:2])) - 0.5 * math.sqrt(3.0) * SIDE - ROD


def _even(record: Reals, times: Reals) -> Reals:
    """A record at times, its frames at equal intervals."""
    rows = np.arange(len(record))
    even = np.polyval(np.polyfit(rows, record[:, 0], 1), rows)
    return np.column_stack([np.interp(times, even, column) for column in record[:, 1:].T])


def fitted(scene: Any, name: str, push: Push, shown: Any, seed: int) -> dict[str, float]:
    """Values of a rung, or of another simulator, fitted to the frames that are shown."""
    return dict(Search(_prepared(scene, name, push, shown, seed), NEVER, None).found().values)


def _prepared(scene: Any, name: str, push: Push, shown: Any, seed: int) -> Any:
    """A rung, or another simulator, and frames of the push."""
    options, other = Options(math.inf, 10, None, None, None, seed), name in OTHERS
    rung = next(each for each in rw.LADDER if each.name == ("dynamic-rigid" if other else name))
    own = prepare(scene, rung, push.motions(shown), OVER[rung.name], None, None, options)
    if not other:
        return own
    pushed = push_peers.Pushed(CORNERS, THICK, MASS, ROD, push.rod, PERIOD)
    return real_peers.with_peer(own, getattr(push_peers, name)(pushed))


def errors_of(scene: Any, name: str, push: Push, values: dict[str, float]) -> Reals:
    """Errors (k - 1, 2) of place and turn in all frames but the first, of one run."""
    one = _prepared(scene, name, push, np.ones(len(push.part), bool), 0)
    runs = one.predictor(one.spans(), NEVER)
    found = runs(np.array([[values[each] for each in runs.over]])).errors[0, 0]
    return np.column_stack([np.hypot(found[:, 0], found[:, 1]), np.abs(found[:, 2])])


def force_off(scene: Any, name: str, push: Push, values: dict[str, float]) -> Reals:
    """How far (k - 1,) the size of the contact force of a run is from that of the measured force."""
    start = np.concatenate([push.rod[0, :2], [0.0], push.part[0], np.zeros(6)])
    known = values | {"x": start[0], "y": start[1]}
    durations = np.full((1, len(push.rod) - 1), PERIOD)
    run = rw.rollout(scene, name, start[None], push.rod[None, 1:], durations, ramp=True, parameters=known)
    size = np.hypot(*run.forces[0].sum(axis=1).T)
    found: Reals = np.abs(size - np.hypot(*push.force[1:].T))
    return found


@dataclass(frozen=True)
class Line:
    """Values of both fits; errors in windows held out: place (m), turn, force (N, of rungs)."""

    engine: str
    surface: str
    values: tuple[dict[str, float], ...]
    means: tuple[Mean, ...]

    def __str__(self) -> str:
        told = []
        for name in self.values[0]:
            unit, scale = UNITS.get(name, ("", 1.0))
            both = " / ".join(f"{scale * each[name]:.3g}" for each in self.values)
            told.append(f"{name} {both}{unit}")
        scales = (1e3, 1.0, 1.0)
        means = [
            f"{m.value * x:.3g} ({m.lower * x:.3g} to {m.upper * x:.3g})"
            for m, x in zip(self.means, scales, strict=False)
        ]
        cells = (self.engine, self.surface, ", ".join(told), *means, *([""] * (3 - len(means))))
        return "| " + " | ".join(cells) + " |"


def scored(push: Push, name: str, surface: str, seed: int) -> Line:
    """A rung, or another simulator, fitted to every other window, and scored in the others; both ways."""
    scene = scene_of(surface, push.rod[0])
    window = np.arange(len(push.part)) // WINDOW
    values, errors = [], np.zeros((len(push.part) - 1, 2 if name in OTHERS else 3))
    for fold in range(2):
        own = fitted(scene, name, push, window % 2 == fold, seed)
        held = (window % 2 != fold)[1:]
        errors[held, :2] = errors_of(scene, name, push, own)[held]
        if name not in OTHERS:
            errors[held, 2] = force_off(scene, name, push, own)[held]
        values.append(own)
    each = [errors[window[1:] == number].mean(axis=0) for number in np.unique(window)]
    return Line(name, surface, tuple(values), tuple(mean_of(column) for column in np.array(each).T))


def table(folder: Path, seed: int) -> None:
    """Lines of a page, one as soon as it is known."""
    push = read(folder)
    sizes = np.hypot(*push.force[1:].T)
    inside = -min(_gap(tip, part) for tip, part in zip(push.rod[:, :2], push.part, strict=True))
    print(f"by its joints the rod is up to {1e3 * inside:.1f} mm inside; force up to {sizes.max():.1f} N")
    print(f"| engine | limit surface | parameters | place, mm | turn, rad | force, of {sizes.mean():.1f} N |")
    print("|" + "---|" * 6, flush=True)
    every = [(name, "ellipsoid") for name in OVER]
    every += [(name, "") for name in OTHERS if find_spec({"box2d": "Box2D"}.get(name, name))]
    every += [(name, "exact") for name in EXACT]
    for name, surface in every:
        line = scored(push, name, surface or "ellipsoid", seed)
        print(replace(line, surface=surface), flush=True)
