"""States of runs: to go on from, to branch from, and to make by hand."""

from __future__ import annotations

import hashlib
import math
import os
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals, Record
from rungwise.models.ladder import Rung, rung
from rungwise.scene.values import shown
from rungwise.simulation.inputs import Segment
from rungwise.simulation.planar.workspace import CLOCK

if TYPE_CHECKING:
    from rungwise.scene import Scene


class StateError(InputError):
    """A state is wrong, or does not belong to the scene; the text is one line that names the field."""


@dataclass(frozen=True, eq=False)
class Memory:
    """What a run hands on from step to step beside q and v: contact modes, forces, deformations and the
    features that carry them, the starts of servos, the length of the next step, work and impulses.

    `values` (w,) is the memory of the run as kernels read it; `scene` is the digest of the scene's text;
    `model`, `theta` and the schedule of `inputs` are the run's.
    """

    values: Reals
    scene: str
    model: Rung
    theta: float
    inputs: tuple[Segment, ...] = ()

    @property
    def clock(self) -> Record:
        """The clock of the run (see `planar.workspace.CLOCK`)."""
        return self.values[: CLOCK.itemsize // 8].view(CLOCK)[0]


@dataclass(frozen=True, eq=False)
class State:
    """Where the bodies of a scene are, and how they move.

    q (n,), v (n,): coordinates and their velocities, in the order of `names`, which are the scene's
    ("part.x3"); time: of the scene. A state of a run has its `memory`, with which a run goes on as if it had
    not been interrupted, bit for bit, on the same rung with the same parameters and options. On another rung,
    or at other parameters, contacts keep their modes, forces and deformations as far as the same features
    touch. A state without memory begins at rest in its contacts.
    """

    names: tuple[str, ...]
    q: Reals
    v: Reals
    time: float = 0.0
    memory: Memory | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        q: Mapping[str, float] | None = None,
        v: Mapping[str, float] | None = None,
        *,
        time: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> State:
        """The scene's start at these parameters, with other values of the named coordinates and speeds.

        A run that begins there says whether bodies overlap and joints are open. Raises StateError for an
        unknown name or a value that is no finite number, SceneError for wrong parameters.
        """
        from rungwise.system.planar.place import start

        names, bound = scene.template.coordinates, scene.bind(parameters)
        places, speeds = np.zeros(len(names)), np.zeros(len(names))
        start(bound.records, places, speeds)
        for field, given, values in (("q", q, places), ("v", v, speeds)):
            for name, value in (given or {}).items():
                if name not in names:
                    raise StateError(f"state.{field}: unknown {shown(name)}; valid: {', '.join(names)}")
                values[names.index(name)] = _finite(f"state.{field}.{name}", value)
        return cls(names, places, speeds, _finite("state.time", time))

    def __repr__(self) -> str:
        places = ", ".join(f"{name}={value:.6g}" for name, value in zip(self.names[:8], self.q, strict=False))
        more = ", ..." if len(self.names) > 8 else ""
        run = "" if self.memory is None else f", of a {self.memory.model.name} run"
        return f"State(time={self.time:.6g}, {places}{more}{run})"

    def __getitem__(self, name: str) -> float:
        """The place of a coordinate."""
        if name not in self.names:
            raise StateError(f"state: unknown {shown(name)}; valid: {', '.join(self.names)}")
        return float(self.q[self.names.index(name)])

    def save(self, file: str | Path) -> Path:
        """Write the state into a file (npz), whole or not at all. Raises OSError."""
        target = Path(file)
        arrays: dict[str, Any] = {
            "names": np.array(self.names), "q": self.q, "v": self.v, "time": np.float64(self.time),
        }  # fmt: skip
        if self.memory is not None:
            m = self.memory
            arrays |= {
                "memory": m.values, "scene": np.array(m.scene), "model": np.array(m.model.name),
                "inertia": np.float64(m.model.inertia), "theta": np.float64(m.theta),
            }  # fmt: skip
        unfinished = target.with_name(f".{uuid.uuid4().hex[:8]}.npz")
        try:
            np.savez(unfinished, **arrays)
            os.replace(unfinished, target)
        finally:
            unfinished.unlink(missing_ok=True)
        return target


def load_state(file: str | Path) -> State:
    """A saved state. Raises FileNotFoundError, and StateError for a file that holds none."""
    try:
        with np.load(file, allow_pickle=False) as saved:
            memory = None
            if "memory" in saved:
                model = rung(str(saved["model"]))
                if model.inertia != float(saved["inertia"]):
                    model = model.with_inertia(float(saved["inertia"]))
                memory = Memory(saved["memory"], str(saved["scene"]), model, float(saved["theta"]))
            names = tuple(str(name) for name in saved["names"])
            return State(names, saved["q"], saved["v"], float(saved["time"]), memory)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        raise StateError(f"state: {Path(file).name[:60]!r} holds no state that was saved") from None


def digest(scene: Scene) -> str:
    """What tells scenes apart: a hash of the file's content."""
    return hashlib.sha256(scene.file.model_dump_json(exclude_unset=True).encode()).hexdigest()


def check_state(state: State, scene: Scene) -> None:
    """Raise StateError unless q, v and time are finite and belong to the scene's coordinates."""
    names = scene.template.coordinates
    if not isinstance(state, State):
        raise StateError(f"state: must be a State, not {shown(state)}")
    if state.names != names:
        raise StateError(
            f"state: has the coordinates {', '.join(state.names)}, and the scene {', '.join(names)}"
        )
    for field, values in (("q", state.q), ("v", state.v)):
        if np.shape(values) != (len(names),):
            raise StateError(f"state.{field}: must have the shape ({len(names)},), not {np.shape(values)}")
        for name, value in zip(names, values, strict=True):
            _finite(f"state.{field}.{name}", value)
    _finite("state.time", state.time)


def _finite(field: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise StateError(f"{field}: must be a number, not {shown(value)}")
    if not math.isfinite(value):
        raise StateError(f"{field}: must be finite, not {value}")
    return float(value)
