"""Where compiled kernels are kept: folders named by a hash of the sources that matter.

A file is the digest of its own name and content, then the compressed content. It is unpickled and run, so
only folders are used that nobody but the user may change (`private`). A wheel may bring files (`make wheel`),
compiled for any processor of its platform; they are looked for in the package alone.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import sys
import tempfile
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import platformdirs
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from rungwise.compilation import private
from rungwise.compilation.entries import entry_name
from rungwise.compilation.progress import compiling

_PACKAGE = Path(__file__).parent.parent
_SHIPPED = _PACKAGE / "kernels"
_ANY_PROCESSOR = ("generic", "")
"""What numba calls the processor and its features under NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES=."""
_DIGEST_BYTES = hashlib.sha256().digest_size
_COMPILER = ("rungwise.compilation.calls", "rungwise.compilation.blocks")
"""Modules that kernels need and name, but do not import."""
_IMPORT = re.compile(r"^ *from (rungwise[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)


@cache
def cache_folder(module: str) -> Path:
    """Folder of the compiled code of exactly these sources of `module`."""
    folder = _root() / _version(module)
    if folder.exists() and (fault := private.open_to_others(folder)):
        _tell(fault)
        return private.of_process() / folder.name
    return folder


def folder_of(kind: str) -> Path:
    """Folder of what else is kept for good, beside the compiled code."""
    return _root() / kind


@cache
def _root() -> Path:
    """The first of the folders for kernels that nobody but the user may change; one of this process alone
    where there is none. That a folder which the user named is not taken is told."""
    faults = []
    for root in _roots():
        place, fault = private.made(root)
        if not fault:
            break
        faults.append(fault)
    else:
        place = private.of_process()
    if faults and (os.environ.get("RUNGWISE_CACHE") or len(faults) == len(_roots())):
        _tell("; ".join(faults))
    return place


@cache
def _tell(fault: str) -> None:
    compiling.tell(f"rungwise: compiled kernels are not kept there: {fault}")


@cache
def _version(module: str) -> str:
    """Name of the compiled code of exactly these sources of `module`, by this version of numba."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_sources(module)):
        digest.update(_digest(source))
    return digest.hexdigest()[:16]


def _roots() -> tuple[Path, Path]:
    chosen = os.environ.get("RUNGWISE_CACHE")
    user = os.getuid() if hasattr(os, "getuid") else "user"
    return (
        Path(chosen) if chosen else platformdirs.user_cache_path("rungwise"),
        Path(tempfile.gettempdir()) / f"rungwise-{user}",
    )


@cache
def _sources(module: str) -> frozenset[Path]:
    """Files of `module` and of all modules that it imports from the package.

    For a module outside the package: every file of the package, and the files beside the module's own file.
    """
    found: set[Path] = set()
    waiting = [module, *_COMPILER]
    while waiting:
        source = _file(waiting.pop())
        if source is not None and source not in found:
            found.add(source)
            waiting += _imports(source)
    if _file(module) in found:
        return frozenset(found)
    own = getattr(sys.modules.get(module), "__file__", None)
    beside = Path(own).resolve().parent.glob("*.py") if own else ()
    return frozenset([*_PACKAGE.rglob("*.py"), *beside])


@cache
def _imports(source: Path) -> tuple[str, ...]:
    found: list[str] = []
    for origin, names in _IMPORT.findall(source.read_text("utf-8")):
        found += [origin, *(f"{origin}.{name}" for name in re.findall(r"\w+", names))]
    return tuple(found)


@cache
def _digest(source: Path) -> bytes:
    return hashlib.sha256(source.read_bytes()).digest()


@cache
def _file(module: str) -> Path | None:
    package, *path = module.split(".")
    place = _PACKAGE.joinpath(*path)
    known = (place.with_suffix(".py"), place / "__init__.py") if package == "rungwise" else ()
    return next((file for file in known if file.is_file()), None)


def _read(file: Path, is_shipped: bool) -> bytes | None:
    """Content of a file of the cache; None where it is missing, damaged, written under another name, or of
    another user. Who may change files of the package may change its code."""
    try:
        with file.open("rb") as opened:
            if not (is_shipped or private.is_own(os.fstat(opened.fileno()))):
                return None
            kept = opened.read()
        content = zlib.decompress(kept[_DIGEST_BYTES:])
    except (OSError, zlib.error):
        return None
    return content if _sealed(file, content) == kept[:_DIGEST_BYTES] else None


def _sealed(file: Path, content: bytes) -> bytes:
    return hashlib.sha256(f"{file.parent.name}/{file.name} ".encode() + content).digest()


def _names_only(names: tuple[str, ...]) -> bytes:
    """In the place of bitcode to copy into callers, the names of the functions to be called."""
    text = "\n".join(f'define void @"{name}"() {{ ret void }}' for name in names)
    return bytes(llvmlite.binding.parse_assembly(text).as_bitcode())


class KernelCache(_Cache):
    """The compiled forms of one function, a file for each; `kind` tells apart kernels that are compiled
    differently.

    A file that is missing, cut off or unreadable is compiled again; where none can be written, all goes on.
    """

    def __init__(
        self, function: Callable[..., object], kind: str, allocates: bool, is_linked: bool, has_entry: bool
    ) -> None:
        self._module = function.__module__
        self._folder = cache_folder(self._module)
        self._allocates, self._is_linked, self._has_entry = allocates, is_linked, has_entry
        self._name = f"{function.__module__}.{function.__qualname__}.{kind}"

    @property
    def cache_path(self) -> str:
        return str(self._folder)

    def load_overload(self, signature: Any, target: Any) -> Any:
        if self._allocates:
            target.refresh()  # starts numba's memory manager, and loads all that compilation needs
        for file in self._files(signature, target):
            content = _read(file, file.is_relative_to(_SHIPPED))
            if content is None:
                continue
            with suppress(Exception):  # what a damaged pickle raises may be anything
                return CompileResult._rebuild(target, *pickle.loads(content))
        compiling.begin()
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        compiling.end()
        file = next(self._files(signature, compiled.target_context))
        (name, how, (code, bitcode)), *others = compiled._reduce()
        own = compiled.fndesc
        if self._has_entry:
            bitcode = _names_only((entry_name(own),))
        elif not self._is_linked:
            bitcode = _names_only((own.llvm_func_name, own.llvm_cpython_wrapper_name))
        content = dumps(((name, how, (code, bitcode)), *others))
        draft = file.with_name(f"{file.name}.{os.getpid()}.{threading.get_ident()}")
        with suppress(OSError):
            file.parent.mkdir(mode=0o700, exist_ok=True)
            draft.write_bytes(_sealed(file, content) + zlib.compress(content))
            draft.replace(file)

    def _files(self, signature: Any, target: Any) -> Iterator[Path]:
        """The user's own file, then the shipped one: named by the keys of numba's own cache, which are the
        types, and the processor."""
        platform, *processor = target.codegen().magic_tuple()
        for root, built_for in (
            (self._folder, processor),
            (_SHIPPED / _version(self._module), _ANY_PROCESSOR),
        ):
            key = f"{self._name} {signature} {(platform, *built_for)}"
            yield root / f"{self._name.removeprefix('rungwise.')}.{_short(key)}"

    def enable(self) -> None:
        pass

    def disable(self) -> None:
        pass

    def flush(self) -> None:
        for file in self._folder.glob(f"{self._name.removeprefix('rungwise.')}.*"):
            file.unlink(missing_ok=True)


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
