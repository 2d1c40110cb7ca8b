"""Sets to files, one for each of several models."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from rungwise.sets.feasible.export import check_mesh
from rungwise.sets.feasible.feasible import FeasibleSet
from rungwise.sets.store import SetError

WRITERS: dict[str, Callable[[FeasibleSet, Path], Path]] = {
    "csv": FeasibleSet.to_csv,
    "mesh": FeasibleSet.to_mesh,
}


def check(wanted: Mapping[str, Path | None], axes: int) -> None:
    """Refuse, before anything is computed, files that `write` could not make. Raises SetError."""
    mesh = wanted.get("mesh")
    if mesh is not None:
        check_mesh(mesh, axes)


def write(found: Sequence[FeasibleSet], wanted: Mapping[str, Path | None]) -> list[Path]:
    """Write files by kind (see `WRITERS`), one for each of several sets, by its name. Raises SetError."""
    written = []
    chosen = {kind: target for kind, target in wanted.items() if target is not None}
    for kind, target in chosen.items():
        for each in found:
            file = (
                target
                if len(found) == 1
                else target.with_stem(f"{target.stem}-{each.name.replace(', ', '-')}")
            )
            try:
                written.append(WRITERS[kind](each, file))
            except OSError as error:
                raise SetError(f"{kind}: {file} cannot be written ({error.strerror or error})") from None
    return written
