"""Numbers by which fits judge, from both sides."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rungwise.fitting import certainty, unlike


def stub(**members: Any) -> Any:
    return SimpleNamespace(**members)


BOX = stub(values=lambda units: units, names=("a", "b"))


@pytest.mark.parametrize(("share", "count"), [(0.06, 2), (0.008, 1)])
def test_minima_fit_alike_that_are_the_deepest_now_and_then(
    share: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = stub(unit=np.full(2, 0.5), second=np.eye(2)[None])
    monkeypatch.setattr(certainty, "minimum", lambda *_: found)
    monkeypatch.setattr(
        certainty, "_bootstrap", lambda *_: (np.zeros((2, 2)), np.array([share, 1.0 - share]))
    )
    monkeypatch.setattr(certainty, "_explains", lambda *_: np.zeros((2, 2)))
    monkeypatch.setattr(certainty, "_open", lambda *_: {})
    predictor = stub(spans=stub(trial=np.zeros(3)))
    weights = stub(take=lambda some: some)
    own = certainty.certainty(predictor, BOX, weights, [found, found], 0, np.arange(3))
    assert own.alike.shape == (count, 2) and own.shares[0] == 1.0 - share


@pytest.mark.parametrize(("deviations", "alike"), [(1.0, True), (6.0, False)])
def test_values_explain_the_motions_whose_loss_is_not_clearly_greater(
    deviations: float, alike: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By so many deviations of the mean of sixteen trials, each of a loss of a hundred or so."""
    trials = 16
    drawn = np.random.default_rng(0).normal(size=trials)
    drawn = (drawn - drawn.mean()) / drawn.std(ddof=1)
    losses = 100.0 * (drawn + deviations / np.sqrt(trials))
    count = 2 * certainty.SLICE
    monkeypatch.setattr(certainty, "span_losses", lambda *_: np.zeros((1 + count, trials)))
    monkeypatch.setattr(certainty, "by_trial", lambda *_: np.tile(losses[:, None], count))
    predictor: Any = lambda points: stub(errors=points)  # noqa: E731
    predictor.spans = stub(trial=np.arange(trials))
    weights = stub(whitened=lambda errors: errors, free=0)
    found = certainty._explains(predictor, BOX, weights, np.full(2, 0.5))
    assert (np.ptp(found, axis=1) > 0.9).all() == alike and (np.ptp(found, axis=1) > 0.0).all() == alike


def _means(errors: np.ndarray[Any, Any]) -> dict[str, float]:
    """Means of the errors (s, g) of one coordinate of one trial."""
    own: Any = object.__new__(unlike._Length)
    own._name, own._observed = "it", errors[..., None]
    own._weights = stub(whitened=lambda each: each, spread=1.0, inverse=None)
    own._predictor = stub(
        spans=stub(trial=np.zeros(len(errors), np.int64), counts=np.ones(errors.shape, bool))
    )
    own._layout = stub(compared=stub(names=("x",)))
    own._cells = [("all", np.ones(errors.shape, bool))]
    own._drawn = lambda *_: np.zeros((0, *errors.shape, 1))
    found = own.means(np.zeros((0, 1)), np.zeros(0), np.random.default_rng(0))
    return dict(zip(found.names, found.values[0].tolist(), strict=True))


def test_one_error_is_no_evidence_and_many_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that parted by chance moves a mean by less than a deviation of it; all that err by two do."""
    monkeypatch.setattr(unlike, "_pulled", lambda *_: np.zeros(1))
    name = "the mean of errors of x all in it"
    far = np.zeros((4, 5))
    far[1, 2] = 1e3
    assert 0.0 < _means(far)[name] < 1.0 / np.sqrt(far.size)
    assert _means(np.full((4, 5), 2.0))[name] == pytest.approx(2.0)


@pytest.mark.parametrize(("moments", "looked"), [(3, False), (20, True)])
def test_means_are_of_several_errors(moments: int, looked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of moments before a contact, of which there are so many."""
    monkeypatch.setattr(unlike, "within", lambda *_: 0.5)
    gaps = np.ones((1, 40, 1))
    gaps[0, moments:] = 0.0
    predictor: Any = stub(
        spans=stub(counts=np.ones((1, 40), bool), aims=None), gaps=lambda *_: gaps, scene=None
    )
    layout: Any = None
    names = [name for name, _ in unlike._cells(predictor, layout, np.zeros(1))]
    assert (unlike.STATES[0] in names) == looked and unlike.STATES[1] in names


@pytest.mark.parametrize(("distance", "batches"), [(0.5, 1), (1.5, 1), (4.0, 2), (8.0, 2), (12.0, 1)])
def test_more_draws_are_made_where_few_leave_doubt(
    distance: float, batches: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is observed is so many deviations of the draws from their mean, of which 4.9 are the limit."""
    asked = list[int]()

    def means(values: Any, _scale: Any, _rng: Any) -> Any:
        asked.append(len(values))
        drawn = np.linspace(-1.0, 1.0, len(values)) / (0.6 if len(values) else 1.0)
        return unlike._Means(np.array([distance, *drawn])[:, None], ["it"], np.array([True]))

    monkeypatch.setattr(unlike, "_Length", lambda *_: stub(means=means))
    unlike.unlike([("it", stub())], stub(), BOX, np.full(1, 0.5), 1e-4 * np.eye(1), 0, True)
    assert len(asked) == 1 + batches


def test_what_one_trial_alone_says_counts_several_times() -> None:
    """Slopes are as without the pull of the trial itself; of a value that no other trial knows, no more can
    be said than that this is more than the slope that is left."""
    trials = 8
    second = np.zeros((trials, 2, 2))
    second[:, 0, 0], second[0, 1, 1] = 1.0, 1.0
    first = np.zeros((trials, 2))
    first[:, 0], first[0, 1] = np.linspace(-0.3, 0.3, trials), 0.1
    found, _ = certainty._unpulled(certainty.Minimum(np.full(2, 0.5), np.ones(trials), first, second))
    pulled = first - first.mean(axis=0)
    assert found[0, 0] / pulled[0, 0] == pytest.approx(np.sqrt(trials / (trials - 1.0)))
    assert 2.0 < found[0, 1] / pulled[0, 1] < 10.0
