"""Run the notebooks, and keep what they print.

    python docs/notebooks/record.py [NAME ...]     after a change of a notebook, or of what it prints

The site shows what is kept, and `tests/test_newcomer.py` compares it with what the cells print.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent


def read(file: Path) -> Any:
    """A notebook as plain values."""
    return json.loads(file.read_text("utf-8"))


def cells(notebook: Any) -> list[Any]:
    """Its cells of code."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def kept(cell: Any) -> str:
    """What a cell is said to print."""
    return "".join(line for output in cell["outputs"] for line in output["text"])


def printed(notebook: Any) -> Iterator[tuple[Any, str]]:
    """Each cell of code and what it prints, run in order in a folder of its own."""
    names: dict[str, object] = {}
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for cell in cells(notebook):
                said = io.StringIO()
                with contextlib.redirect_stdout(said):
                    exec(compile("".join(cell["source"]), "cell", "exec"), names)
                yield cell, said.getvalue()
        finally:
            os.chdir(before)


def main(names: list[str]) -> int:
    """Record the named notebooks, or all; returns the exit code."""
    for file in [FOLDER / f"{name}.ipynb" for name in names] or sorted(FOLDER.glob("*.ipynb")):
        notebook = read(file)
        for number, (cell, said) in enumerate(printed(notebook), 1):
            lines = said.splitlines(keepends=True)
            cell["execution_count"] = number
            cell["outputs"] = [{"name": "stdout", "output_type": "stream", "text": lines}] if said else []
        file.write_text(json.dumps(notebook, ensure_ascii=False, indent=1, sort_keys=True) + "\n", "utf-8")
        print(file)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
