"""Results on disk: every finished batch is kept, and a stopped run goes on where it stopped.

A set is computed by a sequence of batches that depends only on the request and on the answers of earlier
batches. So a restart needs only the log of batches: it answers the same questions from the log until the log
ends. Files appear under their names whole or not at all.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.stored import remove, store_dataset, whole

if TYPE_CHECKING:
    import xarray

REQUEST, BATCHES, STORE = "request.json", "batches", "set.zarr"


class SetError(InputError):
    """A request for a set, or a folder of one, is wrong; the text is one line that names the fault."""


class Log:
    """The finished batches of one request in a folder.

    Raises SetError when the folder holds another request, or holds this request and `resume` is false.
    """

    def __init__(self, folder: Path, request: Mapping[str, object], resume: bool) -> None:
        self.folder = folder / BATCHES
        known = folder / REQUEST
        text = json.dumps(request, indent=1, sort_keys=True)
        if known.is_file():
            if not resume:
                raise SetError(f"out: {folder} holds a set already; give --resume, or another folder")
            if known.read_text("utf-8") != text:
                raise SetError(f"resume: {folder} holds another request; see {REQUEST} in it")
        self.folder.mkdir(parents=True, exist_ok=True)
        _sweep(folder)
        _sweep(self.folder)
        if not known.is_file():
            write(known, text.encode())

    def read(self, number: int, points: Reals) -> tuple[Ints, Reals] | None:
        """Outcomes and margins of a batch if it is kept whole. Raises SetError if the kept batch has other
        points."""
        file = self._file(number)
        if not file.is_file():
            return None
        try:
            with np.load(io.BytesIO(file.read_bytes())) as kept:
                asked, outcome, margin = kept["points"], kept["outcome"], kept["margin"]
        except (ValueError, EOFError, KeyError, BadZipFile):
            return None  # the machine stopped before all of it was on the disk
        if not np.array_equal(asked, points):
            raise SetError(f"resume: {file.name} in {self.folder} is of another request")
        return outcome, margin

    def write(self, number: int, points: Reals, outcome: Ints, margin: Reals) -> None:
        """Keep a batch."""
        with whole(self._file(number)) as draft:
            np.savez(draft, points=points, outcome=outcome, margin=margin)

    def _file(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npz"


_DRAFT = re.compile(r"\.[0-9a-f]{8}(\.\w+)?")


def _sweep(folder: Path) -> None:
    """Remove files that a killed process left half written."""
    for path in folder.iterdir():
        if _DRAFT.fullmatch(path.name):
            remove(path)


def write(target: Path, content: bytes) -> Path:
    """Write a file, whole or not at all. Raises OSError."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with whole(target) as draft:
        draft.write_bytes(content)
    return target


def save(folder: Path, data: xarray.Dataset) -> Path:
    """Write the finished set beside its batches, whole or not at all. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    with whole(folder / STORE) as draft:
        store_dataset(data, draft)
    return folder / STORE


def load(folder: str | Path) -> xarray.Dataset:
    """The finished set of a folder. Raises FileNotFoundError when the folder holds none."""
    import xarray as xr

    store = Path(folder) / STORE
    if not store.is_dir():
        raise FileNotFoundError(f"{folder} holds no finished set ({STORE})")
    data: xarray.Dataset = xr.open_zarr(store, consolidated=False).load()
    return data


def attributes(data: xarray.Dataset) -> dict[str, Any]:
    """The request that a stored set answers."""
    request: dict[str, Any] = json.loads(data.attrs["request"])
    return request
