"""Datasets as zarr stores in folders."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray
    from zarr.core.buffer import Buffer


def store_dataset(data: xarray.Dataset, folder: Path) -> None:
    """Write `data` as a zarr store into `folder`, which is made when missing. Raises OSError.

    The store is made in memory and written file by file: zarr's own writing runs in several threads, and a
    full disk stops each of them, but only one of the errors would reach the caller.
    """
    from zarr.storage import MemoryStore

    files: dict[str, Buffer] = {}
    data.to_zarr(MemoryStore(files), mode="w", consolidated=False)
    for key, content in files.items():
        path = folder / key
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.to_bytes())
