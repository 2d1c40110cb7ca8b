"""Runs of a fit on disk: every finished batch is kept, and a stopped fit goes on where it stopped.

A fit asks for batches that depend only on the request and on the answers before. A restart asks for the same
ones, and takes their answers from the log until it ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.stored import Batches


class FitError(InputError):
    """A folder of a fit is wrong; one line that names the fault."""


class Log(Batches):
    """The finished batches of one request in a folder. Raises FitError (see `Batches`)."""

    def __init__(self, folder: Path, request: Mapping[str, object], resume: bool) -> None:
        super().__init__(folder, request, resume, "fit", FitError)
        self._number = -1

    def next(self) -> tuple[Reals, NDArray[np.bool_], Reals] | None:
        """Errors, which runs ended, and how far starts were moved, of the next batch, if it is kept."""
        self._number += 1
        kept = self.kept(self._number)
        if kept is None or not {"errors", "ended", "moved"} <= kept.keys():
            return None
        return kept["errors"], kept["ended"], kept["moved"]

    def add(self, errors: Reals, ended: NDArray[np.bool_], moved: Reals) -> None:
        """Keep the batch that `next` did not have."""
        self.keep(self._number, errors=errors, ended=ended, moved=moved)
