"""Runs of a fit on disk: every finished batch is kept, and a stopped fit goes on where it stopped.

A fit asks for batches that depend only on the request and on the answers before. A restart asks for the same
ones, and takes their answers from the log until it ends.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.stored import whole

REQUEST, BATCHES = "request.json", "batches"


class FitError(InputError):
    """A folder of a fit is wrong; one line that names the fault."""


class Log:
    """The finished batches of one request in a folder. Raises FitError where the folder holds another
    request, or holds this one and `resume` is false."""

    def __init__(self, folder: Path, request: Mapping[str, object], resume: bool) -> None:
        self._folder, self._number = folder / BATCHES, -1
        known, text = folder / REQUEST, json.dumps(request, indent=1, sort_keys=True)
        if known.is_file():
            if not resume:
                raise FitError(f"out: {folder} holds a fit already; give --resume, or another folder")
            if known.read_text("utf-8") != text:
                raise FitError(f"resume: {folder} holds another request; see {REQUEST} in it")
        self._folder.mkdir(parents=True, exist_ok=True)
        with whole(known) as draft:
            draft.write_text(text, "utf-8")

    def next(self) -> tuple[Reals, NDArray[np.bool_], Reals] | None:
        """Errors, which runs ended, and how far starts were moved, of the next batch, if it is kept."""
        self._number += 1
        try:
            with np.load(self._file) as kept:
                return kept["errors"], kept["ended"], kept["moved"]
        except (OSError, KeyError, ValueError, BadZipFile):
            return None

    def keep(self, errors: Reals, ended: NDArray[np.bool_], moved: Reals) -> None:
        """Keep the batch that `next` did not have."""
        with whole(self._file) as draft:
            np.savez_compressed(draft, errors=errors, ended=ended, moved=moved)

    @property
    def _file(self) -> Path:
        return self._folder / f"{self._number:05d}.npz"
