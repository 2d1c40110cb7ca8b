"""Files of pictures, whole or not there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rungwise.errors import InputError
from rungwise.stored import whole


class ViewError(InputError):
    """A picture cannot be made; the text is one line that says why."""


def write(field: str, target: str | Path, make: Callable[[Path], object]) -> Path:
    """Make the file beside its place and rename it there: it is whole or not there."""
    file = Path(target)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole(file) as draft:
            make(draft)
    except OSError as error:
        raise ViewError(f"{field}: {file} cannot be written ({error.strerror or error})") from None
    return file


def needs_matplotlib(field: str) -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ViewError(f"{field}: needs matplotlib (pip install 'rungwise[view]')") from None
