"""The page of the architecture and the map of the house name what there is."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "rungwise"
PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
STATIONS = re.findall(r"`([\w/]+\.py)`: ((?:`\w+`(?:, )?)+)", PAGE)
MOST_FILES, MOST_LINES = 15, 600


def names_in(file: Path) -> set[str]:
    tree = ast.parse(file.read_text("utf-8"))
    return {n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}


def test_the_page_names_stations() -> None:
    assert len(STATIONS) > 25


@pytest.mark.parametrize(("file", "names"), STATIONS)
def test_each_station_is_where_the_page_says(file: str, names: str) -> None:
    known = names_in(SOURCE / file)
    assert set(re.findall(r"\w+", names)) <= known


def folders() -> list[Path]:
    return [SOURCE, *(f for f in SOURCE.rglob("*") if f.is_dir() and any(f.glob("*.py")))]


@pytest.mark.parametrize("folder", folders(), ids=lambda f: str(f.relative_to(SOURCE.parent)))
def test_rooms_are_small(folder: Path) -> None:
    """A stranger finds a file in a room of at most fifteen, and reads it in one sitting."""
    files = list(folder.glob("*.py"))
    assert len(files) <= MOST_FILES
    assert all(len(file.read_text("utf-8").splitlines()) <= MOST_LINES for file in files)


def test_rooms_say_what_is_inside() -> None:
    for folder in folders():
        assert ast.get_docstring(ast.parse((folder / "__init__.py").read_text("utf-8"))), folder
