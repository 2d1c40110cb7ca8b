"""Reading a problem from a file of any kind that is known."""

from __future__ import annotations

import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np

from rungwise.contact.files.fclib import read_fclib
from rungwise.contact.files.textfile import KINDS, read_text
from rungwise.contact.problem import Problem, matrix, vector
from rungwise.contact.step.problem import ContactProblem
from rungwise.keywords import keywords
from rungwise.wording import choices

_DAMAGED = (
    KeyError, ValueError, OSError, EOFError, NotImplementedError, RuntimeError, MemoryError, AttributeError,
    zipfile.BadZipFile, zlib.error, struct.error, SyntaxError,
)  # fmt: skip
"""Exceptions that reading a damaged archive raises."""
_HDF5, _ZIP = b"\x89HDF", b"PK"


@keywords
def read_problem(path: str | Path, kind: str | None = None) -> Problem | ContactProblem:
    """The problem in `path`: FCLIB (HDF5), Siconos' text (of `kind`, else by its name), ContactBench (npz).

    The problem of a step that `save_hard` kept comes back as assembled. Raises ValueError with one line that
    names the fault.
    """
    path = Path(path)
    if kind is not None and kind not in KINDS:
        raise ValueError(f"kind: unknown {str(kind)[:60]!r}{choices(kind, KINDS)}")
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise ValueError(f"file: {path} is not a regular file")
        with path.open("rb") as file:
            head = file.read(4)
    except OSError as error:
        raise ValueError(f"file: {path} cannot be read ({error.strerror or error})") from None
    if head == _HDF5:
        return read_fclib(path)
    if head.startswith(_ZIP):
        return _read_contactbench(path)
    try:
        return read_text(path, kind)
    except (IndexError, OverflowError, MemoryError) as error:
        raise ValueError(f"file: its sizes or indices are wrong ({' '.join(str(error).split())})") from None


def _read_contactbench(path: Path) -> Problem:
    """The problem of G, g, mus in a file of Simple-Robotics/ContactBench, where the normal comes last."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            G, g, mu = file["G"], np.ravel(file["g"]), np.ravel(file["mus"])
    except _DAMAGED as error:
        raise ValueError(f"file: holds no G, g and mus ({' '.join(str(error).split())})") from None
    G, g, mu = matrix("G", G), vector("g", g), vector("mus", mu)
    order = (3 * np.arange(len(mu))[:, None] + np.array([2, 0, 1])).ravel()
    if G.shape != (len(g), len(g)) or len(g) != len(order):
        raise ValueError(f"G: has shape {G.shape}; mus makes it {(len(order), len(order))}")
    return Problem.local(G[np.ix_(order, order)], g[order], mu)
