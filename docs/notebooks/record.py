"""Run the notebooks, and keep what they print and draw.

    python docs/notebooks/record.py [NAME ...]     after a change of a notebook, or of what it prints

The site shows what is kept, and `tests/test_newcomer.py` compares it with what the cells print. A figure
in the last line of a cell is its picture.
"""

from __future__ import annotations

import ast
import base64
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
    return "".join(line for output in cell["outputs"] for line in output.get("text", ()))


def pictured(cell: Any) -> bool:
    """Whether a cell keeps a picture."""
    return any(output["output_type"] == "execute_result" for output in cell["outputs"])


def printed(notebook: Any) -> Iterator[tuple[Any, str, bytes | None]]:
    """Each cell of code, what it prints and its picture (PNG), run in order in a folder of its own."""
    names: dict[str, object] = {}
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for cell in cells(notebook):
                said = io.StringIO()
                with contextlib.redirect_stdout(said):
                    last = _run("".join(cell["source"]), names)
                yield cell, said.getvalue(), _picture(last)
        finally:
            os.chdir(before)


def _run(source: str, names: dict[str, object]) -> object:
    """Run a cell; the value of its last line, if that is an expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return (
        eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        if isinstance(last, ast.Expr)
        else None
    )


def _picture(value: object) -> bytes | None:
    if not hasattr(value, "savefig"):
        return None
    into = io.BytesIO()
    value.savefig(into, format="png", dpi=100, bbox_inches="tight", metadata={"Software": None})
    return into.getvalue()


def _outputs(number: int, said: str, picture: bytes | None) -> list[Any]:
    found: list[Any] = []
    if said:
        found.append({"name": "stdout", "output_type": "stream", "text": said.splitlines(keepends=True)})
    if picture is not None:
        data = {"image/png": base64.b64encode(picture).decode()}
        found.append(
            {"data": data, "execution_count": number, "metadata": {}, "output_type": "execute_result"}
        )
    return found


def main(names: list[str]) -> int:
    """Record the named notebooks, or all; returns the exit code."""
    for file in [FOLDER / f"{name}.ipynb" for name in names] or sorted(FOLDER.glob("*.ipynb")):
        notebook = read(file)
        for number, (cell, said, picture) in enumerate(printed(notebook), 1):
            cell["execution_count"] = number
            cell["outputs"] = _outputs(number, said, picture)
        file.write_text(json.dumps(notebook, ensure_ascii=False, indent=1, sort_keys=True) + "\n", "utf-8")
        print(file)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
