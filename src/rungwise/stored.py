"""Files and folders that appear whole or not at all, and datasets as zarr stores in folders."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A draft beside a file or a folder, to be written, that then takes its place: what is there under the
    name is whole. Raises OSError."""
    draft = target.with_name(f".{uuid.uuid4().hex[:8]}{target.suffix}")
    old = target.with_name(f".{uuid.uuid4().hex[:8]}.old")
    try:
        yield draft
        if draft.is_dir() and target.is_dir():
            os.replace(target, old)
        os.replace(draft, target)
    finally:
        for path in (draft, old):
            remove(path)


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there and may be removed."""
    with suppress(OSError):
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
