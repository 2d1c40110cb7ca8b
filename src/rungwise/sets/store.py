"""Results on disk: every finished batch is kept, and a stopped run goes on where it stopped.

A set is computed by a sequence of batches that depends only on the request and on the answers of earlier
batches. So a restart needs only the log of batches: it answers the same questions from the log until the log
ends. Files appear under their names whole or not at all.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.stored import Batches, store_dataset, whole

if TYPE_CHECKING:
    import xarray

STORE = "set.zarr"


class SetError(InputError):
    """A request for a set, or a folder of one, is wrong; the text is one line that names the fault."""


class Log(Batches):
    """The finished batches of one request in a folder. Raises SetError (see `Batches`)."""

    def __init__(self, folder: Path, request: Mapping[str, object], resume: bool) -> None:
        super().__init__(folder, request, resume, "set", SetError)

    def read(self, number: int, points: Reals) -> tuple[Ints, Reals] | None:
        """Outcomes and margins of a batch if it is kept. Raises SetError if the kept batch has other
        points."""
        kept = self.kept(number)
        if kept is None or not {"points", "outcome", "margin"} <= kept.keys():
            return None
        if not np.array_equal(kept["points"], points):
            raise SetError(f"resume: {self.file(number).name} in {self.folder} is of another request")
        return kept["outcome"], kept["margin"]


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
