"""States of runs: to go on from, to branch from, and to make by hand."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Reals, Record
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung, rung
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import finite, shown
from rungwise.scene.read import load
from rungwise.simulation.inputs import Segment
from rungwise.simulation.planar.state import workspace as planar
from rungwise.simulation.planar.state.workspace import in_memory
from rungwise.stored import whole
from rungwise.wording import choices


class StateError(InputError):
    """A state is wrong, or does not belong to the scene; the text is one line that names the field."""


class PlaceError(StateError):
    """A run does not begin at a place: bodies overlap, joints are open, or a coordinate is outside its
    travel."""


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
        """The clock of the run (see `planar.state.workspace.CLOCK`)."""
        return self.values[: planar.CLOCK.itemsize // 8].view(planar.CLOCK)[0]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", _frozen(self.values))

    def __reduce__(self) -> tuple[Any, ...]:
        return Memory, (self.values, self.scene, self.model, self.theta, self.inputs)


@dataclass(frozen=True, eq=False)
class State:
    """Positions and velocities of a scene at a time, and the memory of a run.

    q (n,), v (n,): coordinates and their velocities, in the order of `names`, which are the scene's
    ("part.x3"); time: of the scene. A state of a run has a `memory`, with which another run continues as if
    there had been no interruption, bit for bit, on the same rung with the same parameters and options. On
    another rung, or at other parameters, contacts keep their modes, forces and deformations as far as the
    same features touch. A state without memory begins at rest in its contacts. Arrays are read-only.
    """

    names: tuple[str, ...]
    q: Reals
    v: Reals
    time: float = 0.0
    memory: Memory | None = None

    def __post_init__(self) -> None:
        for name in ("q", "v"):
            object.__setattr__(self, name, _frozen(getattr(self, name)))

    def __reduce__(self) -> tuple[Any, ...]:
        return State, (self.names, self.q, self.v, self.time, self.memory)

    @classmethod
    @keywords
    def of(
        cls,
        scene: AnyScene | str | Path | Mapping[str, Any],
        q: Mapping[str, float] | None = None,
        v: Mapping[str, float] | None = None,
        *,
        time: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> State:
        """The scene's start, with other values of some coordinates and speeds.

        Args:
            scene: a scene, the name of one that ships, a path, or a mapping of its fields.
            q: coordinates by name. Quaternions are scaled to unit length.
            v: speeds by name (in space: velocities).
            time: the time of the state.
            parameters: values of the scene's parameters.

        A run begins at the nearest place where no bodies overlap and joints are closed, and says how far that
        is. Raises StateError for an
        unknown name or a value that is no finite number, SceneError for wrong parameters.
        """
        loaded = load(scene)
        names, rates = loaded.template.coordinates, loaded.template.velocities
        places, speeds = loaded.start(parameters)
        for field, given, values, known in (("q", q, places, names), ("v", v, speeds, rates)):
            if not isinstance(given, Mapping | None):
                raise StateError(
                    f"state.{field}: must be a mapping of coordinates to numbers, not {shown(given)}"
                )
            for name, value in (given or {}).items():
                if name not in known:
                    raise StateError(f"state.{field}: unknown {shown(name)}{choices(name, known)}")
                values[known.index(name)] = finite(f"state.{field}.{name}", value, StateError)
        if q:
            loaded.normalise(places, "state.q", StateError)
        return cls(names, places, speeds, finite("state.time", time, StateError))

    def __repr__(self) -> str:
        places = ", ".join(f"{name}={value:.6g}" for name, value in zip(self.names[:8], self.q, strict=False))
        more = ", ..." if len(self.names) > 8 else ""
        run = "" if self.memory is None else f", of a {self.memory.model.name} run"
        return f"State(time={self.time:.6g}, {cut(places + more, 400)}{run})"

    def __getitem__(self, name: str) -> float:
        """The place of a coordinate."""
        if name not in self.names:
            raise StateError(f"state: unknown {shown(name)}{choices(name, self.names)}")
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
                "inputs": np.array(json.dumps([asdict(segment) for segment in m.inputs])),
            }  # fmt: skip
        with whole(target) as draft, draft.open("wb") as stream:
            np.savez(stream, **arrays)
        return target


@keywords
def load_state(file: str | Path) -> State:
    """A saved state. Raises FileNotFoundError, and StateError for a file that holds none."""
    if not isinstance(file, str | os.PathLike):
        raise StateError(f"file: must be a path, not {shown(file)}")
    try:
        # from memory: numpy leaves files that are torn open
        with np.load(BytesIO(Path(file).read_bytes()), allow_pickle=False) as saved:
            return _from_arrays(saved)
    except FileNotFoundError:
        raise
    except Exception:  # of a torn file, zip and numpy raise nearly anything
        raise StateError(f"state: {Path(file).name[:60]!r} holds no saved state") from None


def _from_arrays(saved: Mapping[str, NDArray[Any]]) -> State:
    """The state in a file's arrays. Raises ValueError and more where they hold none."""
    memory = None
    if "memory" in saved:
        model, inertia = rung(str(saved["model"])), float(saved["inertia"])
        if model.inertia != inertia:
            model = model.with_inertia(inertia)
        inputs = tuple(Segment(**fields) for fields in json.loads(str(saved["inputs"])))
        memory = Memory(_row(saved["memory"]), str(saved["scene"]), model, float(saved["theta"]), inputs)
    names = tuple(str(name) for name in saved["names"])
    q, v = _row(saved["q"]), _row(saved["v"])
    if not len(names) == len(q) >= len(v):  # in space a turn has four coordinates and three velocities
        raise ValueError("names, q and v differ in length")
    return State(names, q, v, float(saved["time"]), memory)


def _row(values: NDArray[Any]) -> Reals:
    if not _is_row(values):
        raise ValueError("no row of numbers")
    return values


def digest(scene: AnyScene) -> str:
    """What tells scenes apart, as a hash."""
    return hashlib.sha256(scene.content.encode()).hexdigest()


def check_state(state: State, scene: AnyScene) -> None:
    """Raise StateError unless q, v and time are finite and belong to the scene's coordinates."""
    names = scene.template.coordinates
    if not isinstance(state, State):
        raise StateError(f"state: must be a State, not {shown(state)}")
    if state.names != names:
        raise StateError(f"state: has the coordinates {_listed(state.names)}, and the scene {_listed(names)}")
    for field, values, known in (("q", state.q, names), ("v", state.v, scene.template.velocities)):
        if not isinstance(values, np.ndarray):
            raise StateError(f"state.{field}: must be an array, not {shown(values)}")
        if values.shape != (len(known),):
            raise StateError(f"state.{field}: must have the shape ({len(known)},), not {values.shape}")
        for name, value in zip(known, values, strict=True):
            finite(f"state.{field}.{name}", value, StateError)
    most = scene.farthest
    for name, value in zip(names, state.q, strict=True):
        if abs(value) > most:
            raise StateError(f"state.q.{name}: must be within -{most:g}..{most:g}, not {value:g}")
    scene.normalise(state.q.copy(), "state.q", StateError)
    finite("state.time", state.time, StateError)
    if state.memory is not None and not _is_memory(state.memory):
        raise StateError("state.memory: must be null, or the memory of a run's state")


def memory_of(state: State, scene: str, like: planar.State) -> Memory | None:
    """The memory of a checked state, None where it is of another scene than that of the digest `scene`.

    Raises StateError where it is not a memory of states like this one, or of other q, v or time.
    """
    memory = state.memory
    if memory is None or memory.scene != scene:
        return None
    if memory.values.shape != like.memory.shape:
        raise StateError(
            f"state.memory: has {memory.values.size} numbers, and a run of this scene {like.memory.size};"
            " replace it by None if another version of rungwise saved it"
        )
    for field in ("q", "v", "time"):
        if not np.array_equal(in_memory(like, field, memory.values[None])[0], getattr(state, field)):
            raise StateError(
                f"state.{field}: differs from the state's memory; make a state with State.of,"
                " or replace memory by None, too"
            )
    return memory


def _listed(names: object) -> str:
    are_names = isinstance(names, tuple) and all(isinstance(name, str) for name in names)
    return (", ".join(names) or "none") if are_names else shown(names)  # type: ignore[arg-type]


def _is_memory(memory: object) -> bool:
    return (
        isinstance(memory, Memory)
        and _is_row(memory.values)
        and isinstance(memory.scene, str)
        and isinstance(memory.model, Rung)
        and isinstance(memory.theta, int | float)
    )


def _is_row(values: object) -> bool:
    return isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype == np.float64


def _frozen(values: Reals) -> Reals:
    """An array that nobody writes into; anything else as it is, for `check_state` to refuse."""
    if isinstance(values, np.ndarray) and values.flags.writeable:
        values = values.copy()
        values.flags.writeable = False
    return values
