"""Hard steps of runs as files: what they hold is what the loop tried to solve."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.cli import main
from rungwise.contact.prepare.equivalent import in_contacts
from rungwise.contact.problem import Problem
from rungwise.contact.step.problem import ContactProblem, trim
from rungwise.simulation.core.notes import Note
from rungwise.simulation.reasons import hard_steps as hard
from rungwise.simulation.run import Simulation

h5py = pytest.importorskip("h5py", reason="FCLIB files need h5py")
JAM = {"v2": 0.7, "mu": 1.2}
THROWN = {
    "v1": 0.5528988207952464, "v2": 1.9534689834990235, "mu": 1.334903333580781,
    "restitution": 0.7401364447887634, "angle": -0.00680410590533706, "x": -0.026762708036069616,
}  # fmt: skip
"""Four fingers: steps without solution."""


@pytest.fixture
def notes(monkeypatch: pytest.MonkeyPatch) -> dict[Path, Note]:
    """What the loop said of each file."""
    kept: dict[Path, Note] = {}
    write = hard.HardSteps._write

    def noting(self: hard.HardSteps, index: int, note: Note, *outcome: str) -> Path | None:
        file = write(self, index, note, *outcome)
        if file is not None:
            kept[file] = note
        return file

    monkeypatch.setattr(hard.HardSteps, "_write", noting)
    return kept


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "model", "parameters", "outcomes"),
    [
        ("two_finger", rw.QUASISTATIC_RIGID, JAM, {"no_solution": 12, "jammed": 1}),
        ("two_finger", rw.KINEMATIC, JAM, {"no_solution": 1}),
        ("blocks", rw.QUASISTATIC_RIGID, {"slope": 0.4, "mu": 0.1}, {"unsupported": 1}),
        ("blocks", rw.QUASISTATIC_COMPLIANT, {"slope": 0.4, "mu": 0.1}, {"unsupported": 1}),
    ],
    ids=lambda value: str(value) if isinstance(value, rw.Rung | str) else "",
)
def test_saved_problem_has_the_verdict_of_the_step(
    tmp_path: Path, scene: str, model: rw.Rung, parameters: dict[str, float], outcomes: dict[str, int]
) -> None:
    run = rw.simulate(scene, model, parameters=parameters, save_hard=tmp_path)
    assert run.hard is not None and sorted(run.hard.files) == sorted(tmp_path.iterdir())
    found: dict[str, int] = {}
    for file in run.hard.files:
        outcome = file.stem.rsplit("-", 1)[-1]
        found[outcome] = found.get(outcome, 0) + 1
        wanted = "jammed" if outcome == "no_solution" else outcome
        assert rw.solve(rw.read_problem(file)).status == wanted, file.name
    assert found == outcomes


@pytest.mark.long
def test_steps_without_solution_are_jammed(tmp_path: Path, notes: dict[Path, Note]) -> None:
    rw.simulate("four_finger", rw.DYNAMIC_RIGID, parameters=THROWN, duration=1.2, save_hard=tmp_path)
    for file in notes:
        assert rw.solve(rw.read_problem(file)).status == "jammed", file.name
    assert notes


@pytest.mark.few(5)
@pytest.mark.parametrize("scene", ["two_finger_servo", "two_link", "blocks"])
@pytest.mark.parametrize("model", [rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_COMPLIANT, rw.DYNAMIC_RIGID], ids=str)
def test_drives_joints_and_compliance_come_back(tmp_path: Path, scene: str, model: rw.Rung) -> None:
    """Problems that hold all that there is, solved as ordinary steps: what is read gives the same step."""
    simulation = Simulation(scene, model, save_hard=tmp_path)
    simulation.advance()
    workspace, end = simulation.workspace, simulation.hard
    assert workspace is not None and end is not None
    clock = workspace.state.clock[0]
    problem = trim(workspace.problem, int(clock["free"]), int(clock["contacts"]), int(clock["limited"]))
    file = end.end(workspace, "jammed", problem)
    assert file is not None
    read = rw.read_problem(file)
    assert isinstance(read, ContactProblem)
    for name in ContactProblem.__annotations__:
        np.testing.assert_array_equal(getattr(read, name), getattr(problem, name))
    again = rw.solve(read)
    assert again.status == "solved"
    v = workspace.scratch.x[: len(problem.c)]
    np.testing.assert_allclose(again.v[: len(v)], v, atol=1e-7 * max(np.abs(v).max(), 1e-9))


@pytest.mark.parametrize("d", [2, 3])
def test_equivalent_of_compliance_limits_and_joints(d: int) -> None:
    rng = np.random.default_rng(d)
    n, k, b = 5, 3, 4
    A = rng.normal(size=(n, n))
    R = np.zeros((k * d, k * d))
    for i in (0, 2):
        B = rng.normal(size=(d, d))
        R[i * d : i * d + d, i * d : i * d + d] = B @ B.T
    problem = Problem.balance(
        A @ A.T + np.eye(n), rng.normal(size=n), rng.normal(size=(k * d, n)), rng.normal(size=k * d),
        [0.3, 0.5, 0.0], directions=d, R=R, S=rng.normal(size=(b, n)), w_s=rng.normal(size=b),
        R_s=[0.0, 0.3, 0.0, 0.2], F=[0.2, 0.1, np.inf, np.inf],
    )  # fmt: skip
    made = in_contacts(problem)
    assert len(made.mu) == k + 2 and len(made.lower) - made.velocities == 2
    one, other = rw.solve(problem), rw.solve(made)
    assert one.status == other.status == "solved"
    np.testing.assert_allclose(other.v[:n], one.v, atol=1e-9)
    np.testing.assert_allclose(other.r[: k * d], one.r, atol=1e-9)
    np.testing.assert_allclose(other.r[k * d :].reshape(-1, d)[:, 1], one.z[:2], atol=1e-9)


def test_number_of_files_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, notes: dict[Path, Note]
) -> None:
    monkeypatch.setattr(hard, "FIRST", 3)
    monkeypatch.setattr(hard, "LAST", 2)
    run = rw.simulate("two_finger", rw.QUASISTATIC_RIGID, parameters=JAM, save_hard=tmp_path)
    assert run.hard is not None and run.hard.count == 12 and len(list(tmp_path.iterdir())) == 6
    numbers = [int(file.name.split("-")[0]) for file in run.hard.files]
    assert numbers == [0, 1, 2, 10, 11, 12]
    assert [note.length for note in notes.values()] == sorted(
        (note.length for note in notes.values()), reverse=True
    )


def test_nothing_is_noted_unless_asked() -> None:
    run = rw.simulate("two_finger", rw.QUASISTATIC_RIGID, parameters=JAM)
    assert run.hard is None and run.workspace is not None and run.workspace.scratch.hard.size == 0
    assert "hard" not in run.summary()


def command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["rungwise", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_command_saves_and_solves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sim = ["sim", "two_finger", "--model", "quasistatic-rigid", "--set", "v2=0.7", "--set", "mu=1.2"]
    folder = str(tmp_path / "hard")
    assert command(monkeypatch, *sim, "--save-hard", folder, "--json") == 1
    saved: dict[str, Any] = json.loads(capsys.readouterr().out)["hard"]
    assert saved["steps"] == 12 and len(saved["files"]) == 13
    assert command(monkeypatch, "solve", saved["files"][-1], "--json") == 1
    assert json.loads(capsys.readouterr().out)["status"] == "jammed"
    with h5py.File(saved["files"][-1]) as file:
        assert b"two_finger, quasistatic-rigid" in file["fclib_global/info/title"][()]
        assert b"step 7500" in file["fclib_global/info/description"][()]
    with h5py.File(saved["files"][-1], "r+") as file:  # as others read it
        del file["rungwise"]
    found = rw.solve(rw.read_problem(Path(saved["files"][-1])))
    assert found.status == "jammed" and isinstance(found.problem, Problem)
    assert command(monkeypatch, *sim, "--save-hard", folder) == 2
    last = capsys.readouterr().err.splitlines()[-1]  # lines about kernels that are compiled come before
    assert last == f"rungwise: save_hard: {folder} exists; --force overwrites it"
    assert command(monkeypatch, *sim, "--save-hard", folder, "--force") == 1
    assert len(list(Path(folder).iterdir())) == 13
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert command(monkeypatch, *sim, "--save-hard", str(tmp_path / "other")) == 2
    printed = capsys.readouterr().err
    assert "save_hard: HDF5 needs h5py" in printed and printed.count("\n") == 1


def test_a_run_that_did_not_converge_says_where_its_problem_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its certificate a jam is only not converged."""
    monkeypatch.setattr("rungwise.contact.certify.certify_infeasible", lambda *_: None)
    run = rw.simulate("two_finger", rw.QUASISTATIC_RIGID, parameters=JAM, save_hard=tmp_path)
    assert run.hard is not None and run.outcome.name == "not_converged" and run.problem is not None
    last = run.hard.files[-1]
    assert last.exists() and last.stem.endswith("not_converged") and run.reason.endswith(str(last))
    without = rw.simulate("two_finger", rw.QUASISTATIC_RIGID, parameters=JAM)
    assert "--save-hard" in without.reason and "saved" not in without.reason
