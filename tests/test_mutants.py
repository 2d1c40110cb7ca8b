"""Deliberate faults: their places are there, and each gets the verdict that it deserves."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.test_examples import script

SOUND = "def double(x):\n    return 2 * x\n"
CODES = {"2 * x": 0, "3 * x": 1, "x + x": 0, "forever": None, "nonsense": 2}
"""What tests say of a text in the file."""


def test_every_fault_has_one_place_and_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    mutants = script("benchmarks/mutants.py", monkeypatch)
    names = [fault.name for fault in mutants.FAULTS]
    assert len(names) == len(set(names)) > 30
    for fault in mutants.FAULTS:
        assert (mutants.ROOT / fault.file).read_text("utf-8").count(fault.old) == 1, fault.name
        assert fault.new != fault.old, fault.name
        assert fault.tests and all(_exists(mutants.ROOT, test) for test in fault.tests), fault.name


def _exists(root: Path, test: str) -> bool:
    """Whether there is a file of tests, or the test that is named in it."""
    file, _, name = test.partition("::")
    text = (root / file).read_text("utf-8") if (root / file).is_file() else ""
    return bool(re.search(rf"^def {re.escape(name.partition('[')[0] or 'test_')}", text, re.MULTILINE))


def test_verdicts_are_kept_and_the_tree_stays_as_it_was(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mutants = script("benchmarks/mutants.py", monkeypatch)
    for file in ("src/sums.py", "tests/test_sums.py"):
        (tmp_path / file).parent.mkdir()
        (tmp_path / file).write_text(SOUND)

    def tested(tree: Path, fault: Any, _limit: float) -> int | None:
        assert tree != tmp_path
        text = (tree / fault.file).read_text()
        return next(code for part, code in CODES.items() if part in text)

    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    monkeypatch.setattr(mutants, "COPIED", ("src", "tests"))
    monkeypatch.setattr(mutants, "tested", tested)
    faults = [
        mutants.Fault(f"says {new}", "src/sums.py", "2 * x", new, ("tests/test_sums.py",), "a wrong sum")
        for new in list(CODES)[1:]
    ]
    found = mutants.run(faults, tmp_path / "kept.json", 60.0, False)
    assert [each.verdict for each in found.values()] == ["killed", "survived", "timeout", "void"]
    assert (tmp_path / "src/sums.py").read_text() == SOUND
    monkeypatch.setattr(mutants, "tested", None)  # what is known is not tried again
    assert mutants.run(faults[::-1], tmp_path / "kept.json", 60.0, False) == found
    assert capsys.readouterr().out.count("a wrong sum") == 2 * len(faults)
