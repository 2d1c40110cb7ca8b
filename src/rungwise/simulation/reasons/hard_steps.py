"""Hard steps of a run, saved as files for other solvers, and for `rungwise solve`."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np

from rungwise.contact.files import h5py_library, write_fclib
from rungwise.contact.step import NO_SOLUTION, PROXIMAL, ContactProblem, Unknowns
from rungwise.simulation.core.notes import Note, taken
from rungwise.simulation.planar.state.workspace import Workspace

FIRST, LAST = 80, 20
"""Most files: the first so many hard steps of a run, and of the others the last so many."""
_MEANING = (
    "Unknowns and units are the scene's: velocities, and forces (impulses of the step over its length)."
    " Compliance, which this format has no words for, is a velocity of its own; a force-limited drive or dry"
    " friction is one more contact, of friction 1, after the others, pressed by its limit, whose tangential"
    " force is its own."
)


class HardSteps:
    """Files of a run's hard steps in `folder`.

    A step is hard if it has no solution, also if it is then halved. `count` is the number of hard steps, a
    step tried twice counting once, and `files` are the files written: the first `FIRST`, the last `LAST`, and
    the last problem of a run that ended for want of a solution. The problem of an unsupported step is without
    the inertia that stands for the limit of none; a problem with numbers that are not finite is only counted.

    Raises ValueError for a folder that holds HDF5 files or cannot be written, or if h5py is missing.
    """

    def __init__(self, folder: str | Path, title: str) -> None:
        self.folder, self.title = Path(folder), title
        self.count = 0
        self.files: list[Path] = []
        self._waiting: deque[Note] = deque(maxlen=LAST)
        self._last: ContactProblem | None = None
        h5py_library("save_hard")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            held = min(self.folder.glob("*.hdf5"), default=None)
        except OSError as error:
            raise ValueError(
                f"save_hard: {self.folder} cannot be written ({error.strerror or error})"
            ) from None
        if held is not None:
            raise ValueError(f"save_hard: {self.folder} holds {held.name} already; name another folder")

    def take(self, workspace: Workspace) -> None:
        """Save the notes of the compiled loop since the last call. Raises OSError."""
        notes, lost = taken(workspace.scratch.hard)
        for note in notes:
            if self._last is not None and _same(note.problem, self._last):
                continue
            self._last = note.problem
            if self.count < FIRST:
                self._write(self.count, note)
            else:
                self._waiting.append(note)
            self.count += 1
        self.count += lost

    def summary(self) -> dict[str, object]:
        """Plain values, as `rungwise sim --json` prints them."""
        return {"steps": self.count, "files": [str(file) for file in self.files]}

    def end(
        self, workspace: Workspace, outcome: str = "", problem: ContactProblem | None = None
    ) -> Path | None:
        """Save the last notes, and the `problem` that the run ended with, if any; returns its file. Raises
        OSError."""
        while self._waiting and len(self.files) < FIRST + LAST:
            note = self._waiting[0]
            self._write(self.count - len(self._waiting), note)
            self._waiting.popleft()
        if problem is None:
            return None
        clock, scratch = workspace.state.clock[0], workspace.scratch
        found = Unknowns(scratch.mode, scratch.x, scratch.contact_force, scratch.limited_force)
        last = Note(
            NO_SOLUTION, PROXIMAL, float(clock["residual"]), float(clock["time"]), float(clock["tried"]),
            int(clock["steps"]), problem, workspace.terms.surface, found, found,
        )  # fmt: skip
        return self._write(self.count, last, outcome)

    def _write(self, index: int, note: Note, outcome: str = "no_solution") -> Path | None:
        """The file, or None for a problem with numbers that are not finite."""
        p = note.problem
        if not all(np.isfinite(field).all() for field in (p.H, p.c, p.W, p.R, p.w, p.S, p.R_s, p.w_s)):
            return None
        name = f"{index:06d}-step{note.step}-t{note.time:.6g}-h{note.length:.3g}-{outcome}.hdf5"
        about = (
            f"step {note.step} from time {note.time!r}, length {note.length!r}: {outcome},"
            f" residual {note.residual:.1e}; the first {len(note.problem.c)} velocities are the scene's free"
            f" coordinates, the first {len(note.problem.mu)} contacts its own"
        )
        write_fclib(self.folder / name, note.problem, title=self.title, description=about, math_info=_MEANING)
        self.files.append(self.folder / name)
        return self.folder / name


def _same(one: ContactProblem, other: ContactProblem) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in one.__annotations__)
