"""Names by which expressions, states and trajectories speak of a model: letters, digits and _ alone.

Coordinates are ``body.joint`` for hinges and slides, ``body.x, .y, .z, .qw, .qx, .qy, .qz`` for a free body,
and ``body.joint_qw`` and so on for a ball. Velocities have the same labels, but ``body.rx, .ry, .rz`` (about
the body's axes) for what turns in space.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints

if TYPE_CHECKING:
    import mujoco

PLACES, TURNS, RATES = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("rx", "ry", "rz")
SINGLE = 2
"""Least of MuJoCo's numbers of joints with one coordinate."""
PIECE = "/piece/"
"""Between the name of a geom and the number of a piece that stands for it."""


@dataclass(frozen=True)
class Labels:
    """bodies (b,), geoms (g,), actuators (a,), coordinates (n_q,), velocities (n_v,); turns: for each
    quaternion the number of its first coordinate. Pieces of a geom have its label."""

    bodies: tuple[str, ...]
    geoms: tuple[str, ...]
    actuators: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    turns: tuple[int, ...]


def labels(model: mujoco.MjModel) -> Labels:
    """The labels of a model."""
    bodies = _unique([model.body(b).name for b in range(model.nbody)], "body")
    coordinates: list[str] = []
    velocities: list[str] = []
    turns: list[int] = []
    taken: set[str] = set()
    for j in range(model.njnt):
        body, kind, name = bodies[model.jnt_bodyid[j]], int(model.jnt_type[j]), model.jnt(j).name
        if kind == 0:
            turns.append(len(coordinates) + len(PLACES))
            coordinates += [f"{body}.{each}" for each in PLACES + TURNS]
            velocities += [f"{body}.{each}" for each in PLACES + RATES]
            continue
        own = f"{body}.{label(name) if name else ('turn', 'along', 'angle')[kind - 1]}"
        while own in taken:
            own += "_"
        taken.add(own)
        turns += [len(coordinates)] if kind == 1 else []
        coordinates += [f"{own}_{each}" for each in TURNS] if kind == 1 else [own]
        velocities += [f"{own}_{each}" for each in RATES] if kind == 1 else [own]
    return Labels(
        bodies,
        _of_geoms(model),
        _unique([model.actuator(a).name for a in range(model.nu)], "actuator"),
        tuple(coordinates),
        tuple(velocities),
        tuple(turns),
    )


def wholes(model: mujoco.MjModel) -> Ints:
    """For each geom (g,) the one that it is a piece of, or itself (see `scene.space.meshes`)."""
    names = [model.geom(g).name for g in range(model.ngeom)]
    number = {name: g for g, name in enumerate(names)}
    found = np.arange(model.ngeom)
    for g, name in enumerate(names):
        whole, mark, piece = name.rpartition(PIECE)
        if mark and piece.isdecimal() and whole in number:
            found[g] = number[whole]
    return found


def _of_geoms(model: mujoco.MjModel) -> tuple[str, ...]:
    of = wholes(model)
    own = np.flatnonzero(of == np.arange(model.ngeom)).tolist()
    told = dict(zip(own, _unique([model.geom(g).name for g in own], "geom"), strict=True))
    return tuple(told[g] for g in of.tolist())


def label(name: str) -> str:
    """A name of letters, digits and _."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain[:1].isalpha() else f"n{plain}"


def _unique(names: Sequence[str], kind: str) -> tuple[str, ...]:
    found: list[str] = []
    for number, name in enumerate(names):
        own = label(name) if name else f"{kind}{number}"
        while own in found:
            own += "_"
        found.append(own)
    return tuple(found)


def as_labels(text: str, model: mujoco.MjModel, known: Labels) -> str:
    """A text in which labels stand for the model's own names of bodies, joints and actuators, as far as these
    differ: ``l.1.j.1`` and, alone, ``j.1`` become ``l_1.j_1``."""
    instead: dict[str, str] = {}
    for body, name in enumerate(known.bodies):
        instead[model.body(body).name] = name
    for actuator, name in enumerate(known.actuators):
        instead[model.actuator(actuator).name] = name
    for joint in range(model.njnt):
        place, own = known.coordinates[int(model.jnt_qposadr[joint])], model.jnt(joint).name
        if own and model.jnt_type[joint] >= SINGLE:
            body = int(model.jnt_bodyid[joint])
            for before in ("", f"{model.body(body).name}.", f"{known.bodies[body]}."):
                instead[before + own] = place
    names = sorted((name for name, own in instead.items() if name and name != own), key=len, reverse=True)
    if not names:
        return text
    found = re.compile(rf"(?<![\w.])(?:{'|'.join(map(re.escape, names))})(?!\w)", re.ASCII)
    return found.sub(lambda each: instead[each[0]], text)
