"""A corpus of step problems with their answers, and what any solver makes of it.

    python benchmarks/corpus.py record [FOLDER] [--scenes two_finger pile my_scene.yaml] [--most 150]
    python benchmarks/corpus.py record [FOLDER] --tests tests/simulation
    python benchmarks/corpus.py sample [FOLDER] --into tests/contact/corpus.npz --most 2
    python benchmarks/corpus.py replay [FOLDER] [--solver step] [--cold] [--families]

`record` runs every shipped scene, and heaps of boxes, on each rung that moves bodies, or it runs tests.
It keeps of each such family (of tests: each function) at most so many problems that the first
guess answered, drawn evenly, and as many of the others. Files that are there stay as they are, so an
interrupted recording goes on. `sample` puts a few of each family into one file, of those that are small.
`replay` gives the problems to a solver, warm (from where the run's step began) or cold (from nothing),
and prints, of the families of each kind: how many problems were recorded as solved, how many of these the
solver answers with a residual within the step's tolerance, which the judge computes from the problem as
it was given; of how many the velocities are the recorded ones; how many problems it calls solved that
were recorded as unsolved; the processor time of a problem in microseconds, and its Newton steps (of `groups`
alone), both the median. Velocities
differ, rightly, where a problem has several answers. Where supports have their true pressure, notes do not
know it, and answers differ.
"""

from __future__ import annotations

import argparse
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from piles import pyramid

import rungwise as rw
from rungwise.contact.kinds.cone import KIND as CONE
from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.solver.step import residual_of_groups, solve_groups
from rungwise.contact.step import (
    GUESS,
    NO_SURFACES,
    SOLVED,
    TOLERANCE,
    Elimination,
    Sizes,
    Surfaces,
    Unknowns,
    matrix_size,
)
from rungwise.kernel import Reals
from rungwise.simulation import run
from rungwise.simulation.core.notes import Note, kept, note_all, room_for_notes, taken
from rungwise.simulation.stepping import stepper
from rungwise.system.entries import CROWDED
from rungwise.system.terms import APART
from rungwise.world.run import simulation_of

FOLDER = Path("out/corpus")
PLANE, SPACE, EACH = 20_000, 3000, 20
"""Problems of a run in the plane and in space after which it is ended, and steps between two looks at its
notes."""
SMALL = 30
"""Velocities, contacts and limited rows of a problem of a sample, at most."""
ALIKE = 1e-5
"""Part of the greatest velocity of a problem by which answers differ at most that count as the same."""
HEAPS = (10, 45, 91)
NOWHERE = np.empty((0, 4), np.int64)
"""Entries may be in any column."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["record", "sample", "replay"])
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--scenes", nargs="+", default=[])
    parser.add_argument("--tests", nargs="+", default=[])
    parser.add_argument("--most", type=int, default=150)
    parser.add_argument("--into", type=Path, default=Path("tests/contact/corpus.npz"))
    parser.add_argument("--solver", choices=sorted(SOLVERS), default="step")
    parser.add_argument("--cold", action="store_true")
    parser.add_argument("--families", action="store_true", help="a row for each scene on each rung")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    if asked.what == "record" and asked.tests:
        sys.exit(pytest.main([*asked.tests, "-n", "0"], plugins=[Recorder(asked.folder, asked.most)]))
    if asked.what == "record":
        record(asked.folder, asked.scenes, asked.most)
    elif asked.what == "sample":
        sample(asked.folder, asked.into, asked.most)
    else:
        replay(asked.folder, SOLVERS[asked.solver], asked.cold, asked.families)


def scenes(named: list[str]) -> Iterator[tuple[str, Any]]:
    """Names of scenes, and the scenes."""
    for name in named or [*rw.shipped(), *rw.shipped_in_space()]:
        yield Path(name).stem, rw.load(name)
    for boxes in () if named else HEAPS:
        yield f"heap of {boxes}", rw.load(pyramid(boxes)[0])


def record(folder: Path, named: list[str], most: int) -> None:
    for name, scene in scenes(named):
        for model in rw.LADDER[1:]:
            file = folder / f"{name}, {model.name}.npz"
            if file.exists():
                continue
            began = time.process_time()
            try:
                notes, count, outcome = steps_of(scene, model, most, zlib.crc32(file.name.encode()))
            except rw.InputError as error:
                print(f"{file.stem:45} {error}")
                continue
            save(file, notes)
            took = time.process_time() - began
            print(
                f"{file.stem:45} {count:7} problems, {len(notes):4} kept, {outcome}, {took:.1f} s", flush=True
            )


def save(file: Path, notes: list[Note]) -> None:
    """Write notes into a file, whole or not at all."""
    draft = file.with_suffix(".draft")
    with draft.open("wb") as stream:
        np.savez_compressed(stream, notes=kept(notes))
    draft.replace(file)


def steps_of(scene: Any, model: rw.Rung, most: int, seed: int) -> tuple[list[Note], int, str]:
    """Problems of a run that are kept, how many there were, and how the run ended."""
    sample, made = Sample(most, seed), list[Reals]()
    with noted(made):
        begun = simulation_of(scene, model, frames=3)
    if not made or begun.outcome == rw.Outcome.INVALID.code:
        raise rw.InputError(begun.reason)
    plane, goes_on = isinstance(scene, rw.Scene), True
    while goes_on and sample.seen < (PLANE if plane else SPACE):
        goes_on = begun.advance(EACH) if plane else begun.steps_taken(EACH) == EACH
        sample.take(made[-1])
    return sample.notes, sample.seen, str(begun.result().outcome)


def notes_in(file: Path) -> list[Note]:
    with np.load(file) as saved:
        return taken(saved["notes"])[0]


def sample(folder: Path, into: Path, most: int) -> None:
    """So many easy and so many hard problems of each family; of those that are small such as have most
    contacts."""
    found = list[Note]()
    for file in sorted(folder.glob("*.npz")):
        for easy in (True, False):
            own = [note for note in notes_in(file) if is_easy(note) == easy]
            own = sorted(own, key=lambda note: (-len(note.problem.mu), note.time))[: 20 * most]
            own = [note for note in own if sum(sizes_of(note)) <= SMALL]
            found += own[:: max(1, len(own) // most)][:most]
    save(into, found)
    print(f"{len(found)} problems, {into.stat().st_size / 1e3:.0f} kB")


def is_easy(note: Note) -> bool:
    """Whether the chain's first guess answered it."""
    return note.stage == GUESS and note.status == SOLVED


class Recorder:
    """A plugin of pytest: problems of all runs that tests begin, a file for each function."""

    def __init__(self, folder: Path, most: int) -> None:
        self._folder, self._most = folder, most
        self._samples: dict[str, Sample] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Function) -> Iterator[None]:
        name = f"{item.path.stem}, {getattr(item, 'originalname', item.name)}"
        sample = self._samples.setdefault(name, Sample(self._most, zlib.crc32(name.encode())))
        made = list[Reals]()
        with noted(made):
            found = yield
        for hard in made:
            sample.take(hard)
        return found

    def pytest_sessionfinish(self) -> None:
        for name, sample in self._samples.items():
            if sample.notes:
                save(self._folder / f"{name}.npz", sample.notes)


class Sample:
    """Of the problems that are taken so many easy and so many hard ones, each as likely as any other
    (Vitter's algorithm R)."""

    def __init__(self, most: int, seed: int) -> None:
        self.seen = 0
        self._most, self._rng = most, np.random.default_rng(seed)
        self._kept: dict[bool, list[Note]] = {True: [], False: []}
        self._counts = {True: 0, False: 0}

    @property
    def notes(self) -> list[Note]:
        return [*self._kept[True], *self._kept[False]]

    def take(self, hard: Reals) -> None:
        """Take the notes in an array, which is then empty."""
        notes, lost = taken(hard)
        self.seen += len(notes) + lost
        for note in notes:
            easy = is_easy(note)
            self._counts[easy] += 1
            if len(self._kept[easy]) < self._most:
                self._kept[easy].append(note)
            elif (place := int(self._rng.integers(self._counts[easy]))) < self._most:
                self._kept[easy][place] = note


@contextmanager
def noted(made: list[Reals]) -> Iterator[None]:
    """Runs that begin within the context note all their problems, in arrays that are added to these."""
    plane, space = run.allocate, stepper.scratch_arrays

    def in_plane(template: Any, values: Any, frames: int, _noted: bool = False) -> Any:
        workspace = plane(template, values, frames, True)
        note_all(workspace.scratch.hard)
        made.append(workspace.scratch.hard)
        return workspace

    def in_space(n: int, contacts: int, limited: int, d: int = 2) -> dict[str, Any]:
        arrays = space(n, contacts, limited, room_for_notes(n, contacts, limited, d, 4 * EACH), d)
        note_all(arrays["hard"])
        made.append(arrays["hard"])
        return arrays

    run.allocate, stepper.scratch_arrays = in_plane, in_space
    try:
        yield
    finally:
        run.allocate, stepper.scratch_arrays = plane, space


class Answer(NamedTuple):
    """Whether a solver calls a problem solved, and what it found; and its Newton steps, 0 where it does not
    tell them."""

    solved: bool
    unknowns: Unknowns
    steps: int = 0


Solver = Callable[[Note, Unknowns], Answer]
"""Solves a note's problem from a start, which it may change."""


def step(note: Note, start: Unknowns) -> Answer:
    """What a step runs."""
    p, sizes, halt = note.problem, sizes_of(note), np.zeros(1, np.int64)
    modes = p.R.shape[1] == 2 and sizes.n < CROWDED
    side = matrix_size(*sizes) if modes else 0
    room = Elimination(np.zeros((side, side + 1)), np.zeros(side, np.int64))
    surfaces = surfaces_of(note) if (note.surface != APART).any() else NO_SURFACES
    status, _, _ = solve_problem(p, sizes, start, surfaces, NOWHERE, NOWHERE, room, halt)
    return Answer(status == SOLVED, start)


def groups(note: Note, start: Unknowns) -> Answer:
    """The contact solver alone, without the guess of modes."""
    halt = np.zeros(1, np.int64)
    status, _, _, steps = solve_groups(
        note.problem, sizes_of(note), start, CONE, surfaces_of(note), NOWHERE, NOWHERE, halt
    )
    return Answer(status == SOLVED, start, steps)


def by_solve(note: Note, start: Unknowns) -> Answer:
    """`rw.solve`, which begins where it likes."""
    try:
        found = rw.solve(note.problem)
    except rw.InputError:
        return Answer(False, start)
    v, force, tau = found.v, found.r, found.z
    return Answer(found.status.value == "solved", start._replace(v=v, force=force, tau=tau))


SOLVERS: dict[str, Solver] = {"step": step, "groups": groups, "rw.solve": by_solve}


def surfaces_of(note: Note) -> Surfaces:
    """Rows that share an ellipsoid."""
    return NO_SURFACES._replace(number=note.surface)


def sizes_of(note: Note) -> Sizes:
    return Sizes(len(note.problem.c), len(note.problem.mu), len(note.problem.F))


def started(note: Note, cold: bool) -> Unknowns:
    """A copy of where the step began, or nothing."""
    if not cold:
        return Unknowns(*(part.copy() for part in note.start))
    return Unknowns(*(np.zeros_like(part) for part in note.start))


def judged(note: Note, found: Unknowns) -> float:
    """The residual of an answer, from the problem as it was given."""
    return float(
        residual_of_groups(note.problem, sizes_of(note), found, CONE, surfaces_of(note), NOWHERE, NOWHERE)
    )


def alike(note: Note, found: Unknowns) -> bool:
    """Whether velocities are the recorded ones."""
    known, scale = note.answer.v, float(np.abs(note.answer.v).max(initial=0.0))
    scale = max(scale, float(note.problem.quantum[0]), 1e-300)
    return bool(np.abs(found.v - known).max(initial=0.0) <= ALIKE * scale)


class Row(NamedTuple):
    """What came of one problem."""

    known: bool
    solved: bool
    alike: bool
    took: float
    steps: int


def replay(folder: Path, solver: Solver, cold: bool, families: bool) -> None:
    """Give all problems of the folder to a solver, and print what came."""
    rows: dict[str, list[Row]] = {}
    for file in sorted(folder.glob("*.npz")):
        for note in notes_in(file):
            name = file.stem if families else kind_of(note)
            rows.setdefault(name, []).append(tried(note, solver, cold))
    if not rows:
        sys.exit(f"{folder} has no problems; record some: python benchmarks/corpus.py record {folder}")
    print(f"{'':45} {'solved':>14} {'alike':>7} {'others':>7} {'us':>8} {'steps':>5}")
    for name, own in [*sorted(rows.items()), ("all", [row for each in rows.values() for row in each])]:
        known = [row for row in own if row.known]
        others = sum(row.solved for row in own if not row.known)
        print(
            f"{name:45} {sum(row.solved for row in known):6} of {len(known):4}"
            f" {sum(row.solved and row.alike for row in known):7} {others:3} of {len(own) - len(known):2}"
            f" {1e6 * float(np.median([row.took for row in own])):8.0f}"
            f" {float(np.median([row.steps for row in own])):5.0f}"
        )


def tried(note: Note, solver: Solver, cold: bool) -> Row:
    start, began = started(note, cold), time.process_time()
    answer = solver(note, start)
    took = time.process_time() - began
    solved = answer.solved and judged(note, answer.unknowns) <= TOLERANCE
    same = solved and alike(note, answer.unknowns)
    return Row(note.status == SOLVED, solved, same, took, answer.steps)


def kind_of(note: Note) -> str:
    """What class a problem is of: directions, unknowns by their number, rows of supports, compliance."""
    p, (n, contacts, limited) = note.problem, sizes_of(note)
    size = n + p.R.shape[1] * contacts + limited
    sizes = next(text for most, text in SIZES if size <= most)
    parts = [f"{p.R.shape[1]} directions", sizes, "compliant" if p.R.any() else "rigid"]
    return ", ".join(parts + ["on supports"] * bool((note.surface != APART).any()))


SIZES = ((6, "to 6"), (15, "to 15"), (60, "to 60"), (250, "to 250"), (10**9, "above 250"))

if __name__ == "__main__":
    main()
