"""Other simulators in the place of a rung, and coverage of intervals, in small."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from tests.test_examples import script

SIDE = 0.03
CORNERS = np.array([(-SIDE, -SIDE), (SIDE, -SIDE), (SIDE, SIDE), (-SIDE, SIDE)])
VALUES = {"friction": 0.3, "bounce": 0.0, "time_constant": 0.004, "damping_ratio": 1.0}
ENGINES = [
    pytest.param(name, marks=pytest.mark.skipif(find_spec(module) is None, reason=f"{module} is missing"))
    for name, module in (("mujoco_plane", "mujoco"), ("pymunk", "pymunk"))
]
"""Box2D's module ends the process where warnings are errors."""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_part_falls_turns_and_slides_to_rest_in_each_engine(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    peers = script("benchmarks/real_peers.py", monkeypatch)
    run = getattr(peers, engine)(peers.Outline(CORNERS, 6e-4, "table"))
    flight = run(VALUES)(np.array([0.0, 1.0, 0.1, 0.5, 0.0, 2.0]), [0.05, 0.05])
    x, y, angle = list(flight)[-1]
    assert (x, angle) == pytest.approx((0.05, 0.3), abs=1e-3)
    assert y == pytest.approx(1.0 - 0.5 * 9.81 * 0.01, abs=1e-3)
    sliding = run(VALUES | {"table": -0.01})(np.array([0.0, SIDE - 0.01, 0.0, 0.6, 0.0, 0.0]), [0.4])
    x, y, angle = next(sliding)
    assert x == pytest.approx(0.6**2 / (2 * 0.3 * 9.81), rel=0.1) and abs(angle) < 0.05
    assert y == pytest.approx(SIDE - 0.01, abs=1e-3)


@pytest.mark.long
def test_measured_pushes_lead_to_a_plan(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    example = script("examples/measured_pushes.py", monkeypatch)
    monkeypatch.setattr("sys.argv", ["measured_pushes.py", "--samples", "10"])
    example.main()
    said = capsys.readouterr().out
    assert said.startswith("quasistatic-rigid explains the motions ") and "re-planning: 10 of 10" in said
    assert said.endswith("at the true values: goal\n")


@pytest.mark.long
def test_a_peer_is_fitted_by_the_same_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Motions that MuJoCo makes are fitted by MuJoCo: the friction comes back."""
    pytest.importorskip("mujoco")
    from rungwise import DYNAMIC_RIGID, Motions
    from rungwise.deadline import NEVER
    from rungwise.fitting.prepare import Options, prepare
    from rungwise.fitting.stages import Search

    peers = script("benchmarks/real_peers.py", monkeypatch)
    scene = peers.with_parameters(script("benchmarks/real.py", monkeypatch).DATA / "square_drop.yaml")
    engine = peers.mujoco_plane(peers.Outline(CORNERS, 6e-4, "table"))
    values, times = scene.parameters({"friction": 0.3}), np.arange(21) * 0.01
    rows = []
    for speed in (0.4, 0.6, 0.8):
        start = np.array([0.0, SIDE + 0.0018, 0.0, speed, 0.0, 0.0])
        rows.append(np.vstack([start[:3], *engine(values)(start, np.diff(times))]))
    options = Options(np.inf, 5, None, None, 1, 0)
    motions = Motions(scene.template.coordinates, times, rows)
    one = prepare(scene, DYNAMIC_RIGID, motions, ("friction",), None, None, options)
    found = Search(peers.with_peer(one, engine), NEVER, None).found()
    assert found.values["friction"] == pytest.approx(0.3, abs=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    "case", ["impacts", "mass under gravity", "masses", "support", "stiffness from slow pushes"]
)
def test_true_values_are_within_their_intervals_and_what_is_open_is_named(
    case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    coverage = script("benchmarks/fit_coverage.py", monkeypatch)
    found = coverage.drawn(case, 0, 8)
    assert found.named and not found.wrongly and all(found.within.values())
    assert max(found.widths.values()) < 0.2 and found.cpu_s > 0.0


def test_draws_that_are_done_are_not_made_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    coverage, out = script("benchmarks/fit_coverage.py", monkeypatch), tmp_path / "draws.jsonl"
    draw = {"case": "impacts", "within": {"mu": True, "e": False}, "widths": {"mu": 0.1, "e": 0.2}}
    draw |= {"named": True, "wrongly": False, "misfit": 1.0, "outside": False, "cpu_s": 2.0}
    rest = '{"case": "impacts", "se'  # the run was killed while it wrote
    out.write_text("".join(json.dumps(draw | {"seed": seed}) + "\n" for seed in range(4)) + rest)
    monkeypatch.setattr("sys.argv", [
        "fit_coverage.py", "--draws", "4", "--only", "impacts", "--out", str(out),
    ])  # fmt: skip
    coverage.main()
    said = capsys.readouterr().out
    assert "| impacts | 4 | mu 100.0%, e 0.0% | mu 0.1, e 0.2 |  | 0% | 0% |" in said and "8 s of" in said


def laws_and_squares(monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Any]:
    """The comparison of laws, and a few drops of a square."""
    laws = script("benchmarks/laws.py", monkeypatch)
    peers, data = (
        script("benchmarks/real_peers.py", monkeypatch),
        script("benchmarks/real.py", monkeypatch).DATA,
    )
    over = {laws.RIGID: ("mu", "e"), laws.COMPLIANT: ("mu", "K", "C")}
    scene = peers.with_parameters(data / "square_drop.yaml")
    drops = rw.Motions.from_csv(data / "square_drops.csv").take(range(4))
    return laws, laws.Real("squares", scene, drops, 0.06, over)


def test_laws_of_contact_fit_into_the_scenes_of_real_objects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laws, squares = laws_and_squares(monkeypatch)
    for law in laws.LAWS:
        found = laws.with_law(squares, law).parameters()
        assert set(found) == {*squares.scene.parameters(), *law.over}


@pytest.mark.long
def test_a_law_is_fitted_and_scored_on_trials_held_out(monkeypatch: pytest.MonkeyPatch) -> None:
    laws, squares = laws_and_squares(monkeypatch)
    values, errors = laws.scored(squares, laws.LAWS[1], 0)
    assert set(values) == {"mu", "e"}
    assert all(each.shape == (2,) and (each > 0.0).all() for each in errors)
