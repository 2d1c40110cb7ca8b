"""Numbers of searches are changed where they are written; quick searches find the same with all others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import ModuleType

import pytest

from tests.test_examples import script


@pytest.fixture(scope="module")
def searches() -> Iterator[ModuleType]:
    """The script, which reads the sources once."""
    with pytest.MonkeyPatch.context() as patch:
        yield script("benchmarks/search_numbers.py", patch)


def test_instances_are_planned_with_all_numbers_of_searches_changed(searches: ModuleType) -> None:
    which = searches.numbers()
    assert len(which) > 200
    found = searches.answers(searches.drawn(which, 0, 2.0), ["tasks"])
    assert len(found) == 18 and {answer[0] for answer in found.values()} == {"goal"}, found


@pytest.mark.usefixtures("searches")
def test_parts_stay_parts_growth_stays_growth_and_counts_stay_counts() -> None:
    import changed_numbers

    own: dict[str, object] = {}
    text = 'A, B = 0.5, 3\n"""A part and a count."""\nC: float = 1.5\nD = (0.5, 1)\nE = 2 * B\n'
    exec(changed_numbers.changed(text, {"A": 2.0, "B": 0.5, "C": 0.5, "D": 0.5}), own)
    assert own["A"] == pytest.approx(2.0 / 3.0) and own["B"] == 2 and own["C"] == 1.25
    assert own["D"] == (pytest.approx(1.0 / 3.0), 1) and own["E"] == 4


def test_every_number_of_a_search_is_found_where_it_is_named(searches: ModuleType) -> None:
    import changed_numbers

    factors: dict[str, dict[str, float]] = {}
    for file, name in (*searches.numbers(), *searches.numbers(kernels=True)):
        factors.setdefault(file, {})[name] = 2.0
    for file, own in factors.items():
        text = (changed_numbers.PACKAGE / file).read_text("utf-8")
        assert changed_numbers.changed(text, own).count("_times(") >= len(own)


def test_numbers_that_lose_an_answer_are_found_by_halves(searches: ModuleType) -> None:
    which, tried = [("file.py", str(k)) for k in range(300)], 0

    def loses(part: Sequence[tuple[str, str]]) -> bool:
        nonlocal tried
        tried += 1
        return {"17", "230"} <= {name for _, name in part}

    assert {name for _, name in searches.blamed(which, loses)} == {"17", "230"}
    assert tried <= 24
    assert searches.blamed(which, lambda part: ("file.py", "5") in part) == [("file.py", "5")]


def test_an_answer_is_lost_where_its_word_or_a_value_is_another(searches: ModuleType) -> None:
    before = {"plan": ["goal", [], [], 10], "set": ["", [0.5], [0.02], 100]}
    after = {"plan": ["goal", [], [], 20], "set": ["", [0.51], [0.02], 50]}
    assert searches.lost(before, after) == [] and searches.ratio(before, after) == pytest.approx(1.0)
    assert searches.lost(before, after | {"plan": ["no plan", [], [], 20]}) == ["plan"]
    assert searches.lost(before, after | {"set": ["", [0.53], [0.02], 50]}) == ["set"]
    assert searches.lost(before, after | {"modes: KeyError()": ["raised", [], [], 0]}) == [
        "modes: KeyError()"
    ]
