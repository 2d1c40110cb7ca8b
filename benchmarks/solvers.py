"""Contact problems: what `rw.solve` takes for each, and the best of Siconos' and of Pinocchio's solvers.

    OMP_NUM_THREADS=1 python benchmarks/solvers.py [FOLDER] [--siconos [PYTHON]] [--pinocchio [PYTHON]]
                             [--only TEXT] [--repeats N] [--save FILE] [--chain] [--write FOLDER]

FOLDER holds problem files (FCLIB, Siconos text, ContactBench); without it, ../shared/problems if it is there.
Stacks and piles of boxes are generated in any case; `--write` writes them (FCLIB). Everything is solved to a
residual of 1e-8, and times are medians of N repeats, in microseconds of the processor.

  residual  the worse of the unit-free violations of laws and the imbalance; the status, where not solved
  total     `rw.solve` of a problem never seen, from the problem as it was given to its judged answer
  again     the same of a problem solved before, from nothing: what is prepared from a problem is kept
  warm      the same started from the answer, its forces changed by one part in a million
  compiled  the prepared problem from nothing, called from compiled code: up to 200 unknowns
  near      the same from the answer's forces, changed by one part in a thousand
  chain     (`--chain`) what `rw.solve` tried, and the iterations

A peer's columns, with `--siconos` and `--pinocchio` (Pythons that have them; looked for if not given):

  total     the least of all its solvers, from nothing, that got to the same residual by our judge: the
            solve, what the solver asks for once per problem, and what it took to make the form that it was
            given. The problem as it was given costs nothing; elimination and scaling cost what they cost us.
            Siconos' drivers are called from a loop in C (so `cc` is
            needed), Pinocchio's solvers time themselves
  (1e-05)   in place of a time: none got there, and this is the least residual that one reached
  ratio     our total over the peer's
  alone     the least time of a solve on a problem that lies ready in the solver's own format, whatever was
            prepared for it, to be held against `compiled`, or where there is none against `again`
  solver    which of its solvers has the least total, and what it was given: the problem as it is (`mixed`
            with its velocities and free unknowns), or what is left after elimination, in the problem's own
            units or scaled as ours is (contacts for Siconos dense or in blocks)

Each solver is run with tighter and tighter tolerances of its own until our judge is content; one that is much
slower than the best so far is given up, and a peer gets at most 25 s for a problem (`contact_peers.py`).
Pinocchio is given planar contacts with an idle second tangent. `--save` keeps each finished row in FILE
(JSON), and rows that are there are not measured again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import contact_peers
import numpy as np
import solver_times as times
from assemblies import generated
from peer_process import Peer
from solver_times import TOL

import rungwise as rw
from rungwise.contact.files.fclib import write_fclib
from rungwise.contact.files.read import read_problem

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "problems"
SUFFIXES = (".dat", ".hdf5", ".npz")
WITHIN = 1.5
Running = dict[str, tuple[Peer, contact_peers.Project]]
"""Peers by name, and what writes problems for them."""
PEERS: dict[str, type[contact_peers.Project]] = {
    "siconos": contact_peers.Siconos,
    "pinocchio": contact_peers.Pinocchio,
}


def problems(folder: Path | None) -> Iterator[tuple[str, rw.Problem]]:
    yield from generated()
    for path in sorted(folder.iterdir()) if folder else ():
        if path.suffix in SUFFIXES:
            try:
                yield path.name, read_problem(path)
            except ValueError as error:
                print(f"{path.name}: left out: {error}", file=sys.stderr)


@dataclass
class Row:
    """One line of the table, times in microseconds; peers: name -> what it did, None where it has no form."""

    problem: str
    size: int
    contacts: int
    status: str
    residual: float
    total: float
    again: float
    warm: float
    compiled: float | None
    near: float | None
    chain: str
    peers: dict[str, dict[str, Any] | None]

    def ratio(self, peer: str, alone: bool = False) -> float | None:
        """Our time over the peer's, of the whole or of the solve alone; infinite where only the peer has an
        answer, None where it has none."""
        found = self.peers.get(peer)
        if found is None or found["residual"] > TOL:
            return None
        if self.status != "solved":
            return np.inf
        if alone:
            return (self.again if self.compiled is None else self.compiled) / (1e6 * found["alone"])
        return self.total / (1e6 * found["seconds"])


def measured(name: str, problem: rw.Problem, repeats: int, peers: Running) -> Row:
    found = rw.solve(problem, tol=TOL)  # compiles
    near = found.x * (1.0 + 1e-6)
    rw.solve(problem, tol=TOL, start=near)
    total = times.fresh(problem, lambda new: rw.solve(new, tol=TOL), repeats)
    again = times.usual(lambda: rw.solve(problem, tol=TOL), repeats)
    warm = times.usual(lambda: rw.solve(problem, tol=TOL, start=near), repeats)
    chain = " > ".join(f"{a.solver} {a.iterations}" for a in found.attempts) or "-"
    best: dict[str, dict[str, Any] | None] = {}
    cost = times.preparation(problem, repeats) if peers else contact_peers.Cost()
    for peer, (process, formats) in peers.items():
        told = contact_peers.best(process, formats.forms(problem, cost), problem, TOL)
        best[peer] = None if told is None else asdict(told)
    alone = times.alone(problem, found, repeats)
    return Row(
        name, len(problem.b), len(problem.mu), found.status, found.residuals.worst,
        total, again, warm, alone[0], alone[1], chain, best,
    )  # fmt: skip


LITTLE = 50
KINDS: dict[str, Callable[[Row], bool]] = {
    "contacts": lambda row: row.contacts > 0,
    "no contacts": lambda row: row.contacts == 0,
    f"up to {LITTLE} unknowns": lambda row: row.size <= LITTLE,
    f"more than {LITTLE} unknowns": lambda row: row.size > LITTLE,
}
"""Rows that are summed up together; each is in two of them."""
COLUMNS = {"total": 8, "again": 7, "warm": 7, "compiled": 8, "near": 6}
NAME, SOLVER = 28, 26


def table(rows: list[Row], peers: list[str], chain: bool) -> Iterator[str]:
    """Lines of the table and what they come to."""
    head = f"{'problem':{NAME}s} {'size':>4s} residual"
    head += "".join(f" {name:>{width}s}" for name, width in COLUMNS.items())
    head += "".join(f"  {peer.capitalize():>9s} ratio    alone {'solver':{SOLVER}s}" for peer in peers)
    yield (head + ("  chain" if chain else "")).rstrip()
    for row in rows:
        told = f"{row.residual:8.0e}" if row.status == "solved" else f"{row.status:>8.8s}"
        line = f"{_short(row.problem):{NAME}s} {row.size:4d} {told}"
        line += "".join(f" {_time(getattr(row, name)):>{width}s}" for name, width in COLUMNS.items())
        line += "".join(_beside(row, peer) for peer in peers)
        yield (line + (f"  {row.chain}" if chain else "")).rstrip()
    for names in [[peer] for peer in peers] + ([peers] if len(peers) > 1 else []):
        given = [row for row in rows if any(row.peers[one] for one in names)]
        for kind, belongs in KINDS.items():
            if some := [row for row in given if belongs(row)]:
                yield f"{' or '.join(names).capitalize()}, {kind}: {summary(some, names)}"


def _short(name: str) -> str:
    for suffix in (*SUFFIXES, *SUFFIXES):
        name = name.removesuffix(suffix)
    return name[:NAME]


def _time(microseconds: float | None) -> str:
    return "-" if microseconds is None else f"{microseconds:.{1 if microseconds < 1e4 else 0}f}"


def _beside(row: Row, peer: str) -> str:
    found, ratio = row.peers[peer], row.ratio(peer)
    if found is None:
        return f"  {'-':>9s} {'':{15 + SOLVER}s}"
    if ratio is None:
        time, told, alone = f"({found['residual']:.0e})", "", ""
    else:
        time, told, alone = _time(1e6 * found["seconds"]), f"{ratio:.2f}", _time(1e6 * found["alone"])
    return f"  {time:>9s} {told:>5s} {alone:>8s} {found['solver']:{SOLVER}.{SOLVER}s}"


def summary(rows: list[Row], peers: list[str]) -> str:
    """What the rows come to that were given to some of the peers: ratios to the fastest of these."""
    line = ""
    for kind, alone in (("ratios", False), ("solves alone", True)):
        known = {}
        for row in rows:
            ratios = [ratio for peer in peers if (ratio := row.ratio(peer, alone)) is not None]
            if ratios:
                known[row.problem] = max(ratios)
        line = line or f"{len(known)} of {len(rows)} to {TOL:g}"
        if known:
            worst = max(known, key=lambda name: known[name])
            mean = np.exp(np.mean(np.log(list(known.values()))))
            close = sum(ratio <= WITHIN for ratio in known.values())
            line += "; " if kind == "ratios" else "\n    "
            line += f"{kind}: geometric mean {mean:.2f}, {close} within {WITHIN}"
            line += f", worst {known[worst]:.2f} ({worst})"
    return line


class Store:
    """Rows in a JSON file, or nowhere; another run with the same settings goes on from there.

    Raises
    ------
    ValueError
        where there is a file of another kind or with other settings.
    """

    def __init__(self, file: Path | None, settings: dict[str, object]) -> None:
        self.file, self.settings, self.rows = file, settings, {}
        if file is not None and file.exists():
            try:
                told = json.loads(file.read_text())
                found, rows = told["settings"], [Row(**row) for row in told["rows"]]
            except (ValueError, KeyError, TypeError):
                raise ValueError(f"{file}: is not a file of rows that this benchmark saved") from None
            if found != settings:
                raise ValueError(f"{file}: has rows of other settings, {found} and not {settings}")
            self.rows = {row.problem: row for row in rows}

    def keep(self, row: Row) -> None:
        self.rows[row.problem] = row
        if self.file is not None:
            part = self.file.with_name(self.file.name + ".part")
            told = {"settings": self.settings, "rows": [asdict(row) for row in self.rows.values()]}
            part.write_text(json.dumps(told, indent=1))
            os.replace(part, self.file)


def running(stack: ExitStack, asked: dict[str, str | None]) -> Running:
    """Name -> running peer and its formats, of those that are asked for and can be run."""
    peers: Running = {}
    for name, given in asked.items():
        kind = PEERS[name]
        python = None if given is None else contact_peers.interpreter(kind.needed, given, kind.pythons)
        if python is None:
            if given is not None:
                print(f"--{name}: {given or 'no Python here'} cannot `{kind.needed}`", file=sys.stderr)
            continue
        formats = kind(Path(stack.enter_context(tempfile.TemporaryDirectory())))
        try:
            peers[name] = stack.enter_context(formats.start(python)), formats
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"--{name}: {error}", file=sys.stderr)
    return peers


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER if FOLDER.is_dir() else None)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--only", default="", help="problems whose name has this in it")
    parser.add_argument("--siconos", nargs="?", const="", metavar="PYTHON", help="Debian: python3-siconos")
    parser.add_argument("--pinocchio", nargs="?", const="", metavar="PYTHON", help="pip install 'pin>=4'")
    parser.add_argument("--save", type=Path, metavar="FILE", help="keep finished rows, and go on from them")
    parser.add_argument("--chain", action="store_true", help="print what was tried, too")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the generated problems and end")
    given = parser.parse_args(arguments)
    if given.folder is not None and not given.folder.is_dir():
        parser.error(f"{given.folder}: is not a folder")
    if given.repeats < 1:
        parser.error(f"--repeats: must be at least 1, not {given.repeats}")
    if given.write is not None:
        given.write.mkdir(parents=True, exist_ok=True)
        for name, problem in generated():
            write_fclib(
                given.write / f"{name.replace(', ', '_').replace(' ', '_')}.hdf5", problem, title=name
            )
        return 0
    with ExitStack() as stack:
        peers = running(stack, {name: getattr(given, name) for name in PEERS})
        try:
            store = Store(given.save, {"repeats": given.repeats, "tol": TOL, "peers": list(peers)})
        except ValueError as error:
            parser.error(str(error))
        chosen = [(name, problem) for name, problem in problems(given.folder) if given.only in name]
        for number, (name, problem) in enumerate(chosen, 1):
            began = time.perf_counter()
            if name not in store.rows:
                store.keep(measured(name, problem, given.repeats, peers))
            took = time.perf_counter() - began
            print(f"{number}/{len(chosen)} {name}: {took:.1f} s", file=sys.stderr, flush=True)
    for line in table([store.rows[name] for name, _ in chosen], list(peers), given.chain):
        print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
