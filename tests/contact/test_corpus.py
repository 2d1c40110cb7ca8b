"""Problems of steps that were recorded from shipped scenes and tests, small ones of each family: the chain
answers again what it answered, warm and cold. `benchmarks/corpus.py` records and samples them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from rungwise.contact.step import SOLVED
from rungwise.system.terms import APART
from tests.test_examples import script


@pytest.fixture(scope="module")
def corpus() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        yield script("benchmarks/corpus.py", patch)


@pytest.mark.parametrize("cold", [False, True])
def test_what_was_solved_is_solved_again(corpus: ModuleType, cold: bool) -> None:
    notes = corpus.notes_in(Path(__file__).parent / "corpus.npz")
    assert len(notes) > 300 and {note.problem.R.shape[1] for note in notes} == {2, 3, 4, 6}
    notes = [note for note in notes if note.length < 1e100]  # beyond that forces have few digits
    rows = [(note.status == SOLVED, corpus.tried(note, corpus.step, cold)) for note in notes]
    missed = [k for k, (known, row) in enumerate(rows) if known and not row.solved]
    assert len(missed) <= (1e-2 * len(rows) if cold else 0), missed
    # Supports with their true pressure have ellipsoids here that a step goes on to change.
    alone = [not (note.surface != APART).any() for note in notes]
    unlike = sum(known and own and not row.alike for own, (known, row) in zip(alone, rows, strict=True))
    assert unlike <= (0.2 if cold else 1e-2) * len(rows)


def test_notes_are_kept_as_they_are(corpus: ModuleType, tmp_path: Path) -> None:
    notes = corpus.notes_in(Path(__file__).parent / "corpus.npz")[:20]
    corpus.save(tmp_path / "some.npz", notes)
    again = corpus.notes_in(tmp_path / "some.npz")
    for one, other in zip(notes, again, strict=True):
        for name in one.problem.__annotations__:
            assert np.array_equal(getattr(one.problem, name), getattr(other.problem, name))
        for field in ("start", "answer"):
            for a, b in zip(getattr(one, field), getattr(other, field), strict=True):
                assert np.array_equal(a, b)
        assert (one.status, one.stage, one.time, one.step) == (
            other.status,
            other.stage,
            other.time,
            other.step,
        )
