"""Reading and writing problems, and the command that solves them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import rungwise as rw
from rungwise.cli import main
from rungwise.contact.fclib import write_fclib
from rungwise.contact.read import read_problem

pytest.importorskip("h5py", reason="FCLIB files need h5py")
W = np.array([[2.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]])


def test_local_form_comes_back(tmp_path: Path) -> None:
    problem = rw.Problem.local(W + np.triu(np.ones((3, 3)), 1) * 1e-3, [-1.0, 0.3, 0.2], [0.4])
    write_fclib(tmp_path / "a.hdf5", problem)
    again = read_problem(tmp_path / "a.hdf5")
    np.testing.assert_array_equal(again.A.toarray(), problem.A)
    np.testing.assert_array_equal(again.b, problem.b)
    np.testing.assert_array_equal(again.mu, problem.mu)
    assert list(tmp_path.iterdir()) == [tmp_path / "a.hdf5"]


@pytest.mark.parametrize("directions", [2, 3])
def test_global_form_with_joints_comes_back(tmp_path: Path, directions: int) -> None:
    rng = np.random.default_rng(0)
    problem = rw.Problem.balance(
        sp.csr_array(np.diag([1.0, 2.0, 3.0])), rng.normal(size=3), rng.normal(size=(2 * directions, 3)),
        rng.normal(size=2 * directions), [0.2, 0.7], directions=directions, S=[[1.0, 0.0, 2.0]], w_s=[0.3],
    )  # fmt: skip
    write_fclib(tmp_path / "a.hdf5", problem)
    again = read_problem(tmp_path / "a.hdf5")
    np.testing.assert_array_equal(again.A.toarray(), problem.A.toarray())
    np.testing.assert_array_equal(again.b, problem.b)
    assert again.directions == directions and again.velocities == 3


def test_what_fclib_cannot_say_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^lower:"):
        write_fclib(tmp_path / "a.hdf5", rw.Problem.lcp(np.eye(2), [1.0, 1.0]))
    assert list(tmp_path.iterdir()) == []


TEXTS = {
    "two_lcp.dat": "2\n0\n2 2\n2 2\n2 1\n1 2\n-5 -6",
    "x_mlcp.dat": "1 1 1 1\n0 1 2\n0 1\n0\n2 2\n2 2\n1 -1\n-1 1\n-1 1",
    "relay_1.dat": "2\n0\n2 2\n2 2\n1 0\n0 1\n-0.5 5\n-1 -1\n1 1",
    "one.dat": "3\n1\n0\n3 3\n3 3\n2 0 0\n0 1 0\n0 0 1\n-1 -0.4 0\n0.5",
    "blocks.dat": "3\n1\n1\n3 3\n1 1 1\n3\n3\n2 1\n0 1\n0\n9\n2 0 0 0 1 0 0 0 1\n-1 -0.4 0\n0.5",
}
ANSWERS = {
    "two_lcp.dat": [4 / 3, 7 / 3],
    "x_mlcp.dat": [1.0, 0.0],
    "relay_1.dat": [0.5, -1.0],
    "one.dat": [0.5, 0.25, 0.0],
    "blocks.dat": [0.5, 0.25, 0.0],
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_files(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(TEXTS[name])
    found = rw.solve(read_problem(tmp_path / name))
    assert found.status == "solved"
    np.testing.assert_allclose(found.x, ANSWERS[name], atol=1e-8)


@pytest.mark.parametrize("name", TEXTS)
def test_no_truncated_file_is_a_crash(tmp_path: Path, name: str) -> None:
    for length in range(0, len(TEXTS[name]) - 3, 3):
        (tmp_path / name).write_text(TEXTS[name][:length])
        try:
            read_problem(tmp_path / name)
        except ValueError as error:
            assert "\n" not in str(error)


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["rungwise", "solve", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "a.hdf5", tmp_path / "s.npz"
    problem = rw.Problem.local(W, [-1.0, 0.3, 0.2], [0.4])
    write_fclib(file, problem)
    assert run(monkeypatch, str(file), "--json", "--out", str(out)) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["status"] == "solved" and printed["residual"] <= printed["tol"]
    with np.load(out) as saved:
        np.testing.assert_allclose(saved["u"], W @ saved["r"] + problem.b, atol=1e-14)
        assert saved["r"][0] > 0.0
    assert run(monkeypatch, str(file)) == 0
    assert "solved" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [("no_lcp.dat", "1\n0\n1 1\n1 1\n0\n-1", 1), ("bad_lcp.dat", "1 0 x", 2), ("absent.dat", None, 2)],
)
def test_command_says_no(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    text: str | None,
    code: int,
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    assert run(monkeypatch, str(tmp_path / name)) == code
    printed = capsys.readouterr()
    if code == 2:
        assert printed.err.count("\n") == 1 and printed.err.startswith("rungwise: file:")
    else:
        assert "jammed" in printed.out
