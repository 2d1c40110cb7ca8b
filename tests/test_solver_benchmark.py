"""The benchmark of contact problems, without the other projects that it compares with."""

from __future__ import annotations

import dataclasses
import importlib
import json
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.files.read import read_problem

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


@pytest.mark.long
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

    def row(name: str, own: float, seconds: float, residual: float, status: str = "solved") -> Any:
        told = {"solver": "x", "seconds": seconds, "residual": residual, "alone": 5e-7, "unfinished": []}
        best = {"siconos": told, "pinocchio": None}
        return solvers.Row(name, 3, 1, status, 1e-9, own, 9.0, 9.0, 2.0, None, "-", best)

    rows = [row("a", 4.0, 1e-6, 1e-9), row("b", 1.0, 1e-6, 1e-8), row("c", 1.0, 1e-6, 1e-7)]
    assert [each.ratio("siconos") for each in rows] == [pytest.approx(4.0), pytest.approx(1.0), None]
    assert [each.ratio("siconos", alone=True) for each in rows] == [pytest.approx(4.0)] * 2 + [None]
    told = solvers.summary(rows, ["siconos"])
    assert told.splitlines() == [
        "2 of 3 to 1e-08; ratios: geometric mean 2.00, 1 within 1.5, worst 4.00 (a)",
        "    solves alone: geometric mean 4.00, 0 within 1.5, worst 4.00 (a)",
    ]
    assert row("d", 1.0, 1e-6, 1e-9, "not_converged").ratio("siconos") == np.inf
    lines = list(solvers.table(rows, ["siconos", "pinocchio"], chain=False))
    assert "(1e-07)" in lines[3] and lines[4:] == [
        f"{who}, {kind}: {told}"
        for who in ("Siconos", "Siconos or pinocchio")
        for kind in ("contacts", "up to 50 unknowns")
    ]


@pytest.mark.long
def test_preparation_is_counted_as_we_pay_it(module: Any) -> None:
    """Nothing for what is given as it is."""
    times, boxes = module("solver_times"), module("assemblies")
    given, mixed = problem(3), boxes.stack(1)
    for stated in (given, mixed):
        cost = times.preparation(stated, 3)
        assert cost.scaled > 0.0 and (cost.own > 0.0) == (stated is not given)


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
    assert (found.solver, found.seconds, found.alone) == (
        "fine (form)",
        1e-4,
        1e-4,
    ) and found.residual <= 1e-8
    assert [tol for solver, tol in asked if solver == "rough"] == list(peers.TOLERANCES)
    assert [tol for solver, tol in asked if solver == "late"] == [peers.TOLERANCES[0]]
    found = peers.best(Peer(), [form("rough")], given, 1e-8)
    assert found.residual > 1e-5 and found.solver == "rough (form)"
    assert peers.best(Peer(), [], given, 1e-8) is None


def test_best_counts_what_its_form_and_its_solver_take_to_prepare(module: Any) -> None:
    peers = module("contact_peers")
    given = problem(3)
    exact = rw.solve(given, tol=1e-12).r
    times = {"plain": (5e-5, 0.0), "quick": (1e-5, 0.0), "direct": (1e-6, 6e-5)}

    class Peer:
        def ask(self, task: dict[str, Any], limit: float) -> tuple[Any, float]:
            seconds, preparation = times[task["solver"]]
            assert task["slow"] >= seconds and limit > seconds
            return peers.Answer(seconds, exact, True, preparation), seconds

    def form(name: str, preparation: float, *solvers: str) -> Any:
        return peers.Form(name, solvers, {}, lambda r: r, preparation)

    forms = [form("scaled", 1e-3, "quick"), form("own", 0.0, "plain", "direct")]
    found = peers.best(Peer(), forms, given, 1e-8)
    assert (found.solver, found.seconds, found.alone) == ("plain (own)", 5e-5, 1e-6)
    found = peers.best(Peer(), forms[:1], given, 1e-8)
    assert (found.solver, found.seconds, found.alone) == ("quick (scaled)", pytest.approx(1.01e-3), 1e-5)


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


def complementarity() -> rw.Problem:
    """Free unknowns among complementary ones, of which one is zero; all can be eliminated."""
    root = np.random.default_rng(5).normal(size=(5, 5))
    law = np.array([True, False, True, True, False])
    return rw.Problem.mlcp(root @ root.T + np.eye(5), [-1.0, 2.0, 3.0, -2.0, 0.5], law)


def relay() -> rw.Problem:
    root = np.random.default_rng(6).normal(size=(3, 3))
    M = root @ root.T + np.eye(3)
    return rw.Problem.boxes(M, [4.0, -9.0, 0.3], [-1.0, -0.5, -2.0], [0.5, 1.0, 2.0])


def planar_box() -> rw.Problem:
    """A box of two contacts that slips, with its velocities."""
    W = np.array([[0.0, 1.0, -0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [1.0, 0.0, 0.5]])
    return rw.Problem.balance(
        np.diag([2.0, 2.0, 0.4]), [3.0, -4.0, 0.1], W, np.zeros(4), [0.3, 0.2], directions=2
    )


def test_what_is_no_contact_is_given_as_it_is_and_without_what_is_free(module: Any, tmp_path: Path) -> None:
    peers = module("contact_peers")
    cost = peers.Cost(own=1.0, scaled=2.0)
    for given, own in ((complementarity(), "mixed, own"), (relay(), "own")):
        expected = rw.solve(given, tol=1e-12).x
        forms = {form.name: form for form in peers.Siconos(tmp_path).forms(given, cost)}
        assert list(forms) == [*dict.fromkeys([own, "own", "scaled"])]
        for form in forms.values():
            file = form.task["file"]
            if file.endswith("npz"):
                told = np.load(file)
                read = rw.Problem.lcp(told["M"], told["q"])
            else:
                read = read_problem(file)
            np.testing.assert_allclose(form.whole(rw.solve(read, tol=1e-12).x), expected, atol=1e-9)
        assert (forms["own"].preparation, forms["scaled"].preparation) == (1.0, 2.0)
        assert own == "own" or forms[own].preparation == 0.0


def test_mixed_complementarity_is_given_whole_and_in_blocks(module: Any, tmp_path: Path) -> None:
    """Free unknowns first; our own reader does not look at the blocks."""
    given = complementarity()
    form = next(iter(module("contact_peers").Siconos(tmp_path).forms(given)))
    free, law = np.flatnonzero(given.free), np.flatnonzero(~given.free)
    blocks = [
        given.A[np.ix_(rows, columns)]
        for rows, columns in ((free, free), (law, law), (free, law), (law, free))
    ]
    told = Path(form.task["file"]).read_text().split()
    expected = np.concatenate([*(block.ravel() for block in blocks), given.b[free], given.b[law]])
    np.testing.assert_array_equal(np.array(told[-len(expected) :], float), expected)


def test_planar_balance_is_lifted_to_space(module: Any, tmp_path: Path) -> None:
    given = planar_box()
    expected = rw.solve(given, tol=1e-12)
    forms = {form.name: form for form in module("contact_peers").Siconos(tmp_path).forms(given)}
    form = forms["mixed, lifted"]
    found = rw.solve(read_problem(form.task["file"]), tol=1e-12)
    assert found.status == "solved" and abs(expected.u[1]) > 0.1
    np.testing.assert_allclose(form.whole(found.r), expected.x, atol=1e-9)
    np.testing.assert_allclose(found.r[2::3], 0.0, atol=1e-9)


def test_answer_that_leaves_free_unknowns_wrong_is_not_accepted(module: Any, tmp_path: Path) -> None:
    """Nothing done is right for what is complementary here, and so is no imbalance of the rest."""
    peers = module("contact_peers")
    given = rw.Problem.mlcp([[1.0, 0.5], [0.5, 1.0]], [-1.0, 1.0], [False, True])
    form = next(iter(peers.Siconos(tmp_path).forms(given)))
    answer = np.zeros(2)

    class Peer:
        def ask(self, *_: object) -> tuple[Any, float]:
            return peers.Answer(1e-6, answer, True), 1e-6

    assert peers.best(Peer(), [form], given, 1e-8).residual > 0.1
    answer[0] = 1.0
    assert peers.best(Peer(), [form], given, 1e-8).residual <= 1e-8


def test_siconos_reads_and_solves_its_forms(module: Any, tmp_path: Path) -> None:
    """Each format by a solver of its own, repeated as the benchmark does."""
    peers = module("contact_peers")
    project = peers.Siconos(tmp_path)
    python = peers.interpreter(project.needed, "", project.pythons)
    if python is None or shutil.which("cc") is None:
        pytest.skip("no Siconos here, or no compiler to call it with")
    wanted = {"mlcp": "DIRECT_ENUM", "lcp": "LEMKE", "relay": "LEMKE", "fc2d": "NSGS", "gfc3d": "NSN_AC_WR"}
    seen = set()
    with project.start(python) as peer:
        for given in (complementarity(), relay(), planar_box()):
            for form in project.forms(given):
                kind = form.task["kind"]
                chosen = dataclasses.replace(form, solvers=(wanted[kind],))
                assert peers.best(peer, [chosen], given, 1e-8).residual <= 1e-8, form
                seen.add(kind)
    assert seen == set(wanted)
