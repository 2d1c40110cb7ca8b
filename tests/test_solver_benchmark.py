"""The benchmark of contact problems, without the other projects that it compares with."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.read import read_problem

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Imports from benchmarks/, as a script there does."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))

    def load(name: str) -> ModuleType:
        return importlib.import_module(name)

    return load


def problem(directions: int) -> rw.Problem:
    """Three coupled contacts: at one the offset opens, the others slide or stick."""
    n = 3 * directions
    root = np.random.default_rng(directions).normal(size=(n, n))
    q = np.tile([-1.0, 0.6, -0.3][:directions], 3)
    q[0] = 4.0
    return rw.Problem.local(root @ root.T + np.eye(n), q, [0.4, 0.1, 0.9], directions)


def test_boxes_rest_under_their_weight(module: Any) -> None:
    boxes = module("assemblies")
    for count, stacked in ((10, boxes.stack(10)), (20, boxes.pile(20))):
        found = rw.solve(stacked)
        assert found.status == "solved" and found.residuals.worst <= 1e-8
        ground = found.r[: 3 * 4 * (1 if count == 10 else 6) : 3]
        assert ground.sum() == pytest.approx(count * boxes.GRAVITY, rel=1e-6)
        assert abs(found.v).max() <= 1e-6 * boxes.GRAVITY * boxes.STEP


def test_prints_a_table_and_goes_on_from_its_rows(
    module: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solvers = module("solvers")
    file = tmp_path / "rows.json"
    arguments = ["--only", "stack of 3", "--repeats", "1", "--save", str(file)]
    assert solvers.main(arguments) == 0
    printed = capsys.readouterr()
    head, *rows = printed.out.splitlines()
    assert [row.split(",")[0] for row in rows] == ["stack of 3"] * 2 and "cold" in head
    assert printed.err.splitlines()[-1].startswith("2/2 stack of 3, push 3: ")
    saved = json.loads(file.read_text())["rows"]
    assert all(row["status"] == "solved" and row["residual"] <= 1e-8 for row in saved)
    assert list(tmp_path.iterdir()) == [file]

    def measured(*_: object) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(solvers, "measured", measured)
    assert solvers.main(arguments) == 0
    assert capsys.readouterr().out == printed.out
    for more, complaint in (
        (["--repeats", "2"], "rows of other settings"),
        (["--save", __file__], "is not a file of rows"),
        ([str(tmp_path / "nowhere")], "is not a folder"),
    ):
        with pytest.raises(SystemExit) as ended:
            solvers.main([*arguments, *more])
        assert ended.value.code == 2 and complaint in capsys.readouterr().err


def test_summary_counts_only_rows_at_the_same_residual(module: Any) -> None:
    solvers = module("solvers")

    def row(name: str, own: float, seconds: float, natural: float, status: str = "solved") -> Any:
        told = {"solver": "x", "seconds": seconds, "natural": natural, "unfinished": []}
        best = {"siconos": told, "pinocchio": None}
        return solvers.Row(name, 3, 1, status, 1e-9, 9.0, own, 9.0, None, None, "-", best)

    rows = [row("a", 4.0, 1e-6, 1e-9), row("b", 1.0, 1e-6, 1e-8), row("c", 1.0, 1e-6, 1e-7)]
    assert [each.ratio("siconos") for each in rows] == [pytest.approx(4.0), pytest.approx(1.0), None]
    told = solvers.summary(rows, ["siconos"])
    assert told == "2 of 3 to 1e-08; ratios: geometric mean 2.00, 1 within 1.5, worst 4.00 (a)"
    assert row("d", 1.0, 1e-6, 1e-9, "not_converged").ratio("siconos") == np.inf
    lines = list(solvers.table(rows, ["siconos", "pinocchio"], chain=False))
    assert "(1e-07)" in lines[3] and lines[4:] == [
        f"{who}, contacts: {told}" for who in ("Siconos", "Siconos or pinocchio")
    ]


def test_peer_that_dies_or_does_not_end_is_left(module: Any, tmp_path: Path) -> None:
    process = module("peer_process")
    script = tmp_path / "peer.py"
    script.write_text(
        f"""
import os, sys
import numpy as np
sys.path.insert(0, {str(BENCHMARKS)!r})
from peer_process import Answer, serve, typical

def solve(task):
    print("solvers print")
    if task["solver"] == "dies":
        os.abort()
    while task["solver"] == "hangs":
        pass
    return Answer(typical(lambda times: 0.25 * times, task["slow"]), np.array([1.0, 2.0]), True)

serve(solve)
"""
    )
    with process.Peer(sys.executable, str(script)) as peer:
        assert peer.ask({"solver": "dies", "slow": 1.0}, 5.0)[0] is None
        answer, spent = peer.ask({"solver": "hangs", "slow": 1.0}, 0.2)
        assert answer is None and 0.1 < spent < 2.0
        answer, _ = peer.ask({"solver": "answers", "slow": 1.0}, 5.0)
        assert answer.seconds == 0.25 and list(answer.forces) == [1.0, 2.0] and answer.converged


def test_best_is_the_fastest_that_our_judge_accepts(module: Any) -> None:
    peers = module("contact_peers")
    given = problem(3)
    exact = rw.solve(given, tol=1e-12).r
    asked = []

    class Peer:
        def ask(self, task: dict[str, Any], limit: float) -> tuple[Any, float]:
            assert 0.0 < limit <= peers.LIMITS[-1]
            asked.append((task["solver"], task["tol"]))
            error, seconds = {"rough": (1e-3, 1e-6), "fine": (task["tol"], 1e-4), "late": (0.0, 1.0)}[
                task["solver"]
            ]
            return peers.Answer(seconds, exact * (1.0 + error), True), seconds

    def form(*solvers: str) -> Any:
        return peers.Form("form", solvers, {}, lambda r: r)

    found = peers.best(Peer(), [form("rough", "fine", "late")], given, 1e-8)
    assert (found.solver, found.seconds) == ("fine (form)", 1e-4) and found.natural <= 1e-8
    assert [tol for solver, tol in asked if solver == "rough"] == list(peers.TOLERANCES)
    assert [tol for solver, tol in asked if solver == "late"] == [peers.TOLERANCES[0]]
    found = peers.best(Peer(), [form("rough")], given, 1e-8)
    assert found.natural > 1e-5 and found.solver == "rough (form)"
    assert peers.best(Peer(), [], given, 1e-8) is None


@pytest.mark.parametrize("directions", [2, 3])
def test_what_peers_are_given_is_the_same_problem(module: Any, tmp_path: Path, directions: int) -> None:
    """Read again by our own reader, or put in our order, each form has the solution of the problem."""
    peers = module("contact_peers")
    given = problem(directions)
    expected = rw.solve(given)
    assert (expected.r[::directions] > 0).any() and (expected.u[::directions] > 0.1).any()
    forms = peers.Siconos(tmp_path).forms(given)
    assert len(forms) == 4
    for form in forms:
        found = rw.solve(read_problem(form.task["file"]))
        np.testing.assert_allclose(form.whole(found.r), expected.r, rtol=1e-6, atol=1e-7)
    for form in peers.Pinocchio(tmp_path).forms(given):
        told = np.load(form.task["file"])
        places = (3 * np.arange(3)[:, None] + np.array([2, 0, 1])).ravel()
        lifted = rw.Problem.local(told["G"][np.ix_(places, places)], told["g"][places], told["mu"])
        forces = np.empty(9)
        forces[places] = rw.solve(lifted).r
        np.testing.assert_allclose(form.whole(forces), expected.r, rtol=1e-6, atol=1e-7)


def test_mixed_forms_are_given_condensed_and_whole(module: Any, tmp_path: Path) -> None:
    peers = module("contact_peers")
    given = module("assemblies").stack(2, push=1.0)
    expected = rw.solve(given)
    whole = {form.name: form for form in peers.Siconos(tmp_path).forms(given)}
    read = read_problem(whole["mixed, own"].task["file"])
    np.testing.assert_allclose(rw.solve(read).u, expected.u, atol=1e-7)
    np.testing.assert_allclose(rw.solve(read).v, expected.v, atol=1e-7)
    lcp = rw.Problem.lcp(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-1.0, 1.0]))
    names = [form.name for form in peers.Siconos(tmp_path).forms(lcp)]
    assert names == ["own", "scaled"] and peers.Pinocchio(tmp_path).forms(lcp) == []
