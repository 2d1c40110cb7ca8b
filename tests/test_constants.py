"""Named numbers of the rooms are in the table of their room, with value, kind, and tests that exist."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from types import ModuleType

import pytest

from tests.pages import ROOT
from tests.test_examples import script


@pytest.fixture(scope="module")
def table() -> Iterator[ModuleType]:
    """The script, which reads the sources once."""
    with pytest.MonkeyPatch.context() as patch:
        found = script("docs/constants.py", patch)
        constants = list(found.constants())
        patch.setattr(found, "constants", lambda: constants)
        yield found


def test_every_number_is_listed_once_and_nothing_else(table: ModuleType) -> None:
    named = {(constant.file, constant.name) for constant in table.constants()}
    listed = Counter((entry.file, name) for entry in table.entries() for name in entry.names)
    assert len(named) > 600
    assert sorted(named - set(listed)) == [], "to be listed in docs/constants.txt"
    assert sorted(set(listed) - named) == [], "listed, but no number of the source"
    assert [name for name, count in listed.items() if count > 1] == []


def test_the_page_has_the_values_of_the_source(table: ModuleType) -> None:
    assert (ROOT / "docs/constants.md").read_text("utf-8") == table.page(), "run python docs/constants.py"


def test_what_decides_says_what_it_means_and_trades_and_its_tests_exist(table: ModuleType) -> None:
    meanings = {(constant.file, constant.name): constant.meaning for constant in table.constants()}
    for entry in table.entries():
        assert entry.kind in table.PLAIN or all(meanings[entry.file, name] for name in entry.names), entry
        assert entry.kind in (*table.DECIDING, *table.PLAIN), entry
        assert (entry.kind in table.PLAIN) != bool(entry.smaller and entry.greater), entry
        assert bool(entry.tests) == bool(set("-+") & set(entry.held.split())), entry
        for test in entry.tests:
            file, _, name = test.partition("::")
            text = (ROOT / "tests" / file).read_text("utf-8")
            assert not name or re.search(rf"^def {re.escape(name)}\(", text, re.MULTILINE), test


def test_verdicts_and_acceptances_have_a_test_or_a_measured_factor(table: ModuleType) -> None:
    assert [table.unheld("verdict"), table.unheld("acceptance")] == [[], []]


def test_numbers_of_searches_have_a_test_or_a_measured_factor(table: ModuleType) -> None:
    """See docs/benchmarks.md on how to measure the factor of a new number."""
    assert table.unheld("search") == [], "run benchmarks/search_numbers.py, see docs/constants.py --open"


def test_every_number_is_used(table: ModuleType) -> None:
    texts = {
        file.relative_to(table.SOURCE).as_posix(): file.read_text() for file in table.SOURCE.rglob("*.py")
    }
    assert [each for each in table.constants() if not _is_used(each.name, each.file, texts)] == []


def _is_used(name: str, file: str, texts: dict[str, str]) -> bool:
    """Whether the file has the name again, or another one imports it from there, or the module."""
    word, module = (
        re.compile(rf"\b{name}\b"),
        file.removesuffix(".py").removesuffix("/__init__").replace("/", "."),
    )
    imported = re.compile(rf"from rungwise\.{module} import\b")
    of_module = f"{module.rpartition('.')[2]}.{name}"
    return len(word.findall(texts[file])) > 1 or any(
        bool(imported.search(text) and word.search(text)) or of_module in text for text in texts.values()
    )


def test_numbers_that_are_free_are_changed_where_they_are_written(monkeypatch: pytest.MonkeyPatch) -> None:
    decades = script("benchmarks/decades.py", monkeypatch)
    own: dict[str, object] = {}
    exec(decades.changed('A, B = 2.0, 3\n"""Two numbers."""\nC = 2.0 * A\n', {"A", "B"}, 0.1), own)
    assert (own["A"], own["B"], own["C"]) == (0.2, 1, 0.4)
    for factor, numbers in decades.free().items():
        assert factor > 1.0
        for file in {file for file, _ in numbers}:
            text = (decades.ROOT / "src/rungwise" / file).read_text("utf-8")
            assert decades.changed(text, {name for own, name in numbers if own == file}, factor) != text


def test_runs_notice_another_outcome_and_another_end(monkeypatch: pytest.MonkeyPatch) -> None:
    decades = script("benchmarks/decades.py", monkeypatch)
    before = {("one", "rung"): ("goal", [0.0, 1.0], 1.0)}
    for after, count in (
        (("goal", [0.0, 1.02], 1.0), 0),
        (("goal", [0.0, 1.1], 1.0), 1),
        (("jammed", [0.0, 1.0], 1.0), 1),
    ):
        assert len(decades.notices(before, {("one", "rung"): after})) == count
