"""Files and folders that appear whole or not at all, and datasets as zarr stores in folders."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from rungwise.errors import InputError

if TYPE_CHECKING:
    import xarray
    from zarr.core.buffer import Buffer


REQUEST, BATCHES = "request.json", "batches"
_DRAFT = re.compile(r"\.[0-9a-f]{8}(\.\w+)?")


class Batches:
    """The finished batches of one request in a folder, as arrays, by number. Raises the error where the
    folder holds another request, or this one, a `thing`, and `resume` is false; and where `resume` is true
    and the folder holds other files, but no request."""

    def __init__(
        self, folder: Path, request: Mapping[str, object], resume: bool, thing: str, error: type[InputError]
    ) -> None:
        self.folder = folder / BATCHES
        known = folder / REQUEST
        text = json.dumps(request, indent=1, sort_keys=True)
        if known.is_file():
            if not resume:
                raise error(f"out: {folder} holds a {thing} already; give --resume, or another folder")
            if known.read_text("utf-8") != text:
                raise error(f"resume: {folder} holds another request; see {REQUEST} in it")
        elif resume and _is_foreign(folder):
            raise error(f"resume: {folder} holds no {thing} to go on from")
        self.folder.mkdir(parents=True, exist_ok=True)
        _sweep(folder)
        _sweep(self.folder)
        if not known.is_file():
            with whole(known) as draft:
                draft.write_bytes(text.encode())

    def kept(self, number: int) -> dict[str, np.ndarray[Any, Any]] | None:
        """A batch, if it is kept whole."""
        try:
            with np.load(io.BytesIO(self.file(number).read_bytes())) as kept:
                return dict(kept)
        except (OSError, ValueError, EOFError, BadZipFile):
            return None  # the machine stopped before all of it was on the disk

    def keep(self, number: int, **arrays: np.ndarray[Any, Any]) -> None:
        with whole(self.file(number)) as draft:
            np.savez(draft, **arrays)  # type: ignore[arg-type]

    def file(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npz"


def _is_foreign(folder: Path) -> bool:
    """Whether there is more in a folder than a killed process leaves before it writes its request."""
    if not folder.is_dir():
        return folder.exists()
    return any(path.name != BATCHES and not _DRAFT.fullmatch(path.name) for path in folder.iterdir())


def _sweep(folder: Path) -> None:
    """Remove files that a killed process left half written."""
    for path in folder.iterdir():
        if _DRAFT.fullmatch(path.name):
            remove(path)


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


def installed() -> str:
    """The version of the package that runs, asked by name: the package's stub imports this file."""
    return str(import_module("rungwise").__version__)
