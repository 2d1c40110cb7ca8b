"""Which rung explains motions; fits that are stopped and go on; the command."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise import cli
from rungwise.deadline import NEVER
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.score import PHASES, mean_of, phase_of

from .drops import DEVIATIONS, NAMES, SCENE, TRUE, drops

OVER = ("mu", "e")


def explained(motions: rw.Motions, **options: Any) -> rw.Explanation:
    models = ("kinematic", "dynamic-rigid")
    return rw.explain(SCENE, motions, OVER, models=models, threads=1, **options)


@pytest.mark.long
def test_the_rung_that_made_the_motions_explains_them() -> None:
    found = explained(drops(12, 40), held_out=0.34)
    assert found.adequate == found.best == "dynamic-rigid"
    assert (found.fitted, found.held_out) == (8, 4)
    assert set(found.rungs["kinematic"].fit.open) == {"mu", "e"}
    assert found.rungs["kinematic"].score.whole.lower > 2 * found.rungs["dynamic-rigid"].score.whole.upper
    assert "kinematic fails in " in found.verdict and found.verdict in str(found)
    told = found.summary()
    assert told["rungs"]["dynamic-rigid"]["parameters"] == 2 and not told["rungs"]["kinematic"]["as_good"]


@pytest.mark.long
def test_phases_are_what_happens() -> None:
    """A drop flat onto the table without a bounce: flight, an impact, sliding, rest."""
    state = np.array([[0.0, 0.07, 0.0, 1.0, 0.0, 0.0]])
    flat = {"mu": 0.5, "e": 0.0}
    run = rw.rollout(
        SCENE, "dynamic-rigid", state, durations=np.full((1, 100), 0.004), parameters=flat, tol=1e-5
    )
    places = np.concatenate([state[:, None, :3], run.q], axis=1)
    known = {name: DEVIATIONS[name] for name in NAMES}
    motions = rw.Motions(NAMES, 0.004 * np.arange(101), places, deviations=known)
    options = Options(None, 10, None, None, 1, 0)
    one = prepare(SCENE, rw.DYNAMIC_RIGID, motions, OVER, None, None, options)
    short = one.predictor(one.short(), NEVER)
    which = phase_of(short, one.layout, np.array([0.5, 0.0]))
    names = [PHASES[k] for k in which]
    assert list(dict.fromkeys(names)) == ["flight", "impact", "sliding", "rest"]
    landed = np.sqrt(2 * 0.04 / 9.81)
    assert short.spans.first[names.index("impact")] <= landed <= short.spans.first[names.index("sliding")]
    stopped = landed + (1.0 - 0.5 * 9.81 * landed) / (0.5 * 9.81)
    assert names[-1] == "rest" and short.spans.first[names.index("rest")] == pytest.approx(stopped, abs=0.03)


def test_the_interval_of_a_mean_is_that_of_its_normal_limit() -> None:
    values = np.random.default_rng(1).normal(2.0, 0.3, 400)
    found = mean_of(values)
    half = 1.96 * values.std() / 20.0
    assert found.value == pytest.approx(values.mean())
    assert (found.upper - found.lower) / 2 == pytest.approx(half, rel=0.1)


@pytest.mark.long
def test_a_fit_goes_on_from_the_batches_that_are_kept(tmp_path: Path) -> None:
    motions, options = drops(4), {"threads": 1, "out": tmp_path}
    whole = rw.fit(SCENE, "dynamic-rigid", motions, OVER, **options)  # type: ignore[arg-type]
    with pytest.raises(rw.FitError, match="holds a fit already; give --resume, or another folder"):
        rw.fit(SCENE, "dynamic-rigid", motions, OVER, **options)  # type: ignore[arg-type]
    kept = sorted((tmp_path / "batches").iterdir())
    for file in kept[len(kept) // 2 :]:
        file.unlink()
    again = rw.fit(SCENE, "dynamic-rigid", motions, OVER, resume=True, **options)  # type: ignore[arg-type]
    assert again.values == whole.values and again.intervals == whole.intervals
    assert len(list((tmp_path / "batches").iterdir())) == len(kept)
    with pytest.raises(rw.FitError, match=r"holds another request; see request\.json in it"):
        rw.fit(SCENE, "dynamic-rigid", motions, ("mu",), resume=True, **options)  # type: ignore[arg-type]


@pytest.mark.long
def test_an_interrupt_gives_the_best_so_far() -> None:
    def stop(what: str, _done: int, _known: int) -> None:
        if what.startswith("least squares"):
            raise KeyboardInterrupt

    motions = drops(6)
    found = rw.fit(SCENE, "dynamic-rigid", motions, OVER, threads=1, keep_interrupted=True, on_progress=stop)
    assert "the search was interrupted before" in found.unfinished and found.unfinished in str(found)
    assert found.values == pytest.approx(TRUE, abs=0.05) and not found.ok
    with pytest.raises(KeyboardInterrupt):
        rw.fit(SCENE, "dynamic-rigid", motions, OVER, threads=1, on_progress=stop)


@pytest.mark.long
def test_the_command_fits_and_writes_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*words: str) -> int:
        monkeypatch.setattr(sys, "argv", ["rungwise", *words])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0)

    scene, data, out = tmp_path / "square.yaml", tmp_path / "drops.csv", tmp_path / "found"
    scene.write_text(rw.load(SCENE).yaml())
    drops(6, 30).save(data)
    told = [f"--deviation={name}={value}" for name, value in DEVIATIONS.items()]
    command = ["fit", str(scene), "--data", str(data), "--model", "dynamic-rigid", "--over", "mu,e=0.2:0.6"]
    assert run(*command, *told, "--threads", "1", "--out", str(out), "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["values"] == pytest.approx(TRUE, abs=0.05) and answer["open"] == {}
    assert rw.load(out / "scene.yaml").parameters()["mu"] == answer["values"]["mu"]
    assert run(*command, "--deviation", "square.x") == 2
    assert "deviation: 'square.x' must be name=number" in capsys.readouterr().err
    assert run(*command, "--resume") == 2
    assert "resume: needs --out, the folder with the kept batches" in capsys.readouterr().err
