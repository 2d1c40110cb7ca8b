"""Parameters from motions that a rung made, with noise."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.fitting import stages

from .drops import SCENE, TRUE, drops

RUNG = "dynamic-rigid"


def fitted(motions: rw.Motions, over: tuple[str, ...] = ("mu", "e"), **options: object) -> rw.Fit:
    return rw.fit(SCENE, RUNG, motions, over, threads=1, **options)  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_friction_and_restitution_come_back(seed: int) -> None:
    found = fitted(drops(12, seed=seed))
    for name, true in TRUE.items():
        low, high = found.intervals[name]
        assert low - 0.02 <= true <= high + 0.02 and high - low < 0.1
    assert found.ok and not found.outside and found.ended == 1.0


@pytest.mark.long
def test_without_noise_values_are_those_that_made_the_motions() -> None:
    found = fitted(drops(6, noise=0.0), span=np.inf)
    assert found.values == pytest.approx(TRUE, abs=2e-3)


@pytest.mark.long
def test_rates_follow_by_regression_where_none_were_measured() -> None:
    found = fitted(drops(10, rates=False))
    assert found.values == pytest.approx(TRUE, abs=0.05)


@pytest.mark.long
def test_a_tilted_table_is_outside() -> None:
    tilted = fitted(drops(8, 50, tilt=np.deg2rad(2.0)))
    assert tilted.outside and "outside" in str(tilted)
    assert "no parameters of mu, e explain" in tilted.verdict


@pytest.mark.long
def test_the_tilt_is_found_where_it_is_asked_for() -> None:
    found = fitted(drops(8, tilt=np.deg2rad(2.0)), ("mu", "e", "tilt"))
    assert not found.outside and found.values["tilt"] == pytest.approx(np.deg2rad(2.0), abs=5e-3)


@pytest.mark.long
def test_mass_under_gravity_alone_is_named_as_open() -> None:
    found = fitted(drops(6), ("mu", "mass"), parameters={"e": 0.4})
    assert set(found.open) == {"mass"} and not found.ok
    assert found.intervals["mass"] == pytest.approx((0.1, 10.0))
    assert "not determined: mass" in str(found)


@pytest.mark.long
def test_the_scene_found_has_the_values_and_what_remains_uncertain() -> None:
    task = {"uncertain": {"e": {"normal": ["e", 0.3]}, "mass": {"uniform": [0.9, 1.1]}}}
    found = rw.fit(SCENE | {"task": task}, RUNG, drops(6), ("mu", "e"), threads=1)
    scene = found.scene
    assert scene.parameters()["mu"] == found.values["mu"]
    assert scene.file.task.uncertain["e"].uniform == found.intervals["e"]
    assert scene.file.task.uncertain["mass"].uniform == (0.9, 1.1)


def test_a_limit_leaves_the_best_so_far_and_says_so() -> None:
    with pytest.raises(rw.LimitError, match="limit: the time was over before candidates had run"):
        fitted(drops(4), limit=0.0)


@pytest.mark.long
def test_explained_motions_of_more_spans_than_a_search_takes_are_tested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, number in (("FEW", 6), ("MANY", 8), ("MOST", 12)):
        monkeypatch.setattr(stages, name, number)
    found = fitted(drops(6))
    assert found.unlike is not None and not found.outside


@pytest.mark.long
def test_the_same_seed_gives_the_same_fit() -> None:
    motions = drops(4)
    first, again = fitted(motions), fitted(motions)
    assert first.values == again.values and first.intervals == again.intervals


@pytest.mark.long
def test_starts_that_overlap_are_moved_out() -> None:
    sunk = drops(6)
    for trial in sunk.trials:
        trial.q[:, 1] -= 2e-3
    found = fitted(sunk, span=0.03)
    assert 0.0 < found.moved < 5e-3 and found.ended == 1.0


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"over": ("mo",)}, "over: unknown parameter 'mo'; valid: mu, e, mass, tilt"),
        ({"over": ("mu",), "box": {"e": (0, 1)}}, "box: 'e' is not in `over`; valid: mu"),
        ({"over": ("mu",), "box": {"mu": (0.5, 0.2)}}, "box.mu: must ascend within 0 to 1, not 0.5 to 0.2"),
        ({"over": ("mu",), "span": -1.0}, "span: must be a time greater than 0, or infinite, not -1.0"),
        ({"over": ("mu",), "parameters": {"mu": 0.2}}, "parameters.mu: is given, and `over` asks for it"),
    ],
)
def test_wrong_arguments_are_one_line(options: dict[str, object], line: str) -> None:
    with pytest.raises(ValueError, match=line):
        rw.fit(SCENE, RUNG, drops(2), **options)  # type: ignore[arg-type]
