"""The one compile decorator.

Every hot function of the package is a *kernel*: arrays in, arrays out, compiled by numba, and still X
"""

from __future__ import annotations

import hashlib
import importlib
import os
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numba
import numpy as np
import platformdirs
from numpy.typing import NDArray

Reals: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
RecordArray: TypeAlias = NDArray[np.void]
Record: TypeAlias = Any
"""One element of a record array: its fields are known to numba, not to the type checker."""

F = TypeVar("F", bound=Callable[..., object])


def record_type(integers: str, reals: str) -> np.dtype[np.void]:
    """Type of a record array with these fields, each 8 bytes wide: `array[0].name` reads and writes one, in
    compiled code and in plain Python alike. Raises ValueError for a name that an array has already, which
    plain Python would read instead."""
    for name in (integers + " " + reals).split():
        if hasattr(np.record, name):
            raise ValueError(f"{name}: a record array has an attribute of this name")
    fields = [(name, np.int64) for name in integers.split()] + [(name, np.float64) for name in reals.split()]
    return np.dtype((np.record, fields))


def kernel(function: F) -> F:
    """Compile `function` on first call, without the GIL, with IEEE division, cached on disk.

    A kernel allocates nothing: it is compiled without reference counting, which would otherwise be paid for
    each array of each call, and numba refuses it if it allocates.
    """
    return _compile(function)


def allocating_kernel(function: F) -> F:
    """A kernel that may allocate: for rare work of unknown size, never for a hot path."""
    return _compile(function, allocates=True)


def inner_kernel(function: F) -> F:
    """A kernel that becomes a part of each that calls it, where a call would take as long as the work."""
    return _compile(function, forceinline=True)


def summing_kernel(function: F) -> F:
    """An inner kernel whose sums are taken in whatever order is fastest, several terms at a time."""
    return _compile(function, forceinline=True, fastmath={"reassoc", "contract"})


def _compile(function: F, allocates: bool = False, **options: object) -> F:
    compiled = numba.njit(nogil=True, error_model="numpy", _nrt=allocates, **options)(function)
    if hasattr(compiled, "enable_caching"):
        with _numba_cache(cache_folder(function.__module__)):
            compiled.enable_caching()
    return compiled  # type: ignore[no-any-return]


@cache
def cache_folder(module: str) -> Path:
    """Folder of the compiled code of exactly these sources of `module`; made when missing.

    Falls back to the temporary folder where the user's cache cannot be written.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_sources(module)):
        digest.update(source.read_bytes())
    chosen = os.environ.get("RUNGWISE_CACHE")
    for root in (Path(chosen) if chosen else platformdirs.user_cache_path("rungwise"), _private_temporary()):
        folder = root / digest.hexdigest()[:16]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="rungwise-"))


_IMPORT = re.compile(r"^ *from (rungwise[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)


def _sources(module: str) -> set[Path]:
    """Files of `module` and of all that it imports from the package; every file for a module outside it."""
    found: set[Path] = set()
    waiting = [module]
    while waiting:
        source = _file(waiting.pop())
        if source is None or source in found:
            continue
        found.add(source)
        for origin, names in _IMPORT.findall(source.read_text("utf-8")):
            waiting += [origin, *(f"{origin}.{name}" for name in re.findall(r"\w+", names))]
    return found or set(Path(__file__).parent.rglob("*.py"))


def _file(module: str) -> Path | None:
    package, *path = module.split(".")
    place = Path(__file__).parent.joinpath(*path)
    known = (place.with_suffix(".py"), place / "__init__.py") if package == "rungwise" else ()
    return next((file for file in known if file.is_file()), None)


def is_compiled(module: str = "rungwise.simulation.loop", entry: str = "advance") -> bool:
    """Whether the kernel `entry` of exactly these sources has been compiled and kept before."""
    return any(cache_folder(module).rglob(f"*{entry}*.nbi"))


def _private_temporary() -> Path:
    return Path(tempfile.gettempdir()) / f"rungwise-{os.getuid() if hasattr(os, 'getuid') else 'user'}"


@contextmanager
def _numba_cache(folder: Path) -> Iterator[None]:
    """Point numba's cache at `folder` while one kernel is declared; other users of numba keep theirs."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


@kernel
def copy(source: NDArray[Any], target: NDArray[Any]) -> None:
    """target[...] = source, of one shape, with one dimension or two (numba's own assignment makes a temporary
    copy, and reshaping is a call)."""
    if target.ndim == 1:
        for i in range(target.shape[0]):
            target[i] = source[i]
    else:
        for i in range(target.shape[0]):
            for j in range(target.shape[1]):
                target[i, j] = source[i, j]


def main() -> None:
    """Compile and cache all kernels: begin each shipped scene on each rung, at fixed and controlled steps."""
    # Run as a program, this file is a second module beside the one whose kernels the package uses.
    package, cached = importlib.import_module("rungwise"), importlib.import_module("rungwise.kernel")
    began = time.perf_counter()
    models = [model for model in package.LADDER if model.moves]
    for name in package.shipped():
        scene = package.load(name)
        for model in models:
            for tol in (None, 1e-2):
                package.Simulation(scene, model, tol=tol).advance()
            names = tuple(scene.file.parameters)[:1]
            defaults = [[scene.file.parameters[name].default for name in names]]
            package.Batch(scene, model, names, duration=1e-3, threads=1).run(np.array(defaults))
    took = time.perf_counter() - began
    root = cached.cache_folder("rungwise.simulation.loop").parent
    print(f"rungwise: kernels of {len(models)} rungs are ready in {root} ({took:.0f} s)")


if __name__ == "__main__":
    main()
