"""Reading and writing problems, and the command that solves them."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import rungwise as rw
from rungwise.cli import main
from rungwise.contact.files.fclib import write_fclib
from rungwise.contact.files.read import read_problem
from rungwise.contact.step.problem import allocate_problem

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


@pytest.mark.parametrize("yielding", [0.0, 0.1])
def test_a_guess_has_a_force_for_each_contact_of_the_file(tmp_path: Path, yielding: float) -> None:
    import h5py

    problem = rw.Problem.balance(
        np.eye(1), [-1.0], np.array([[1.0], [0.0], [0.0]]), [0.0] * 3, [0.5], R=yielding * np.eye(3),
        S=[[1.0]], w_s=[0.0], F=[0.2],
    )  # fmt: skip
    write_fclib(tmp_path / "a.hdf5", problem, [0.8, 0.1, 0.0])
    with h5py.File(tmp_path / "a.hdf5") as file:
        np.testing.assert_array_equal(file["guesses/1/r"][()], [0.8, 0.1, 0.0, 0.0, 0.0, 0.0])
        assert len(file["fclib_global/vectors/mu"]) == 2
    wrong: tuple[object, ...] = ([0.8], [NAN, 0.0, 0.0], "text", np.array([1j, 0.0, 0.0]))
    for r in wrong:
        with pytest.raises(ValueError, match=r"^r:"):
            write_fclib(tmp_path / "b.hdf5", problem, r)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == [tmp_path / "a.hdf5"]


@pytest.mark.parametrize("directions", [1, 2, 3])
def test_drives_without_contacts_come_back_as_contacts(tmp_path: Path, directions: int) -> None:
    none = np.zeros((0, 2))
    problem = rw.Problem.balance(
        np.diag([1.0, 2.0]), [3.0, 0.1], none, [], [], directions=directions, S=np.eye(2), w_s=[0.0, 0.0],
        F=[1.0, 1.0],
    )  # fmt: skip
    write_fclib(tmp_path / "a.hdf5", problem)
    again = rw.solve(read_problem(tmp_path / "a.hdf5"))
    assert again.status == "solved"
    np.testing.assert_allclose(again.v[:2], [2.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(again.v[:2], rw.solve(problem).v, atol=1e-8)


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


def test_blocks_of_rows_that_contradict_the_sizes_are_refused(tmp_path: Path) -> None:
    for ends in ("0 1 5", "0 5 1", "0 -1 2", "1 2"):
        (tmp_path / "x_mlcp.dat").write_text(f"1 1 1 1\n{ends}\n0 1\n0\n2 2\n2 2\n1 -1\n-1 1\n-1 1")
        with pytest.raises(ValueError, match=r"^file: "):
            read_problem(tmp_path / "x_mlcp.dat")


@pytest.mark.parametrize("name", ["W/m", "W/n"])
def test_a_size_that_no_memory_holds_is_refused_at_once(tmp_path: Path, name: str) -> None:
    import h5py

    file = tmp_path / "a.hdf5"
    rw.write_fclib(file, rw.Problem.local(W, [-1.0, 0.3, 0.2], [0.4]))
    with h5py.File(file, "r+") as opened:
        opened[f"fclib_local/{name}"][0] = 2**31 - 1
    with pytest.raises(ValueError, match=r"^W: has shape .*2147483647"):
        read_problem(file)
    (tmp_path / "x_lcp.dat").write_text("2\n1\n2000000000 2000000000\n2 1 1\n2 2\n")
    with pytest.raises(ValueError, match=r"^file: is too short"):
        read_problem(tmp_path / "x_lcp.dat")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ValueError, match=r"^file: .* is not a regular file$"):
        read_problem(tmp_path / "pipe")


def test_an_unknown_kind_is_refused_whatever_the_file(tmp_path: Path) -> None:
    rw.write_fclib(tmp_path / "a.hdf5", rw.Problem.local(W, [-1.0, 0.3, 0.2], [0.4]))
    with pytest.raises(ValueError, match=r"^kind: unknown 'magic'; valid: lcp"):
        read_problem(tmp_path / "a.hdf5", "magic")


def refuses(path: Path, what: str) -> None:
    """Reads it, or says in one line what is wrong with which field."""
    try:
        read_problem(path)
    except ValueError as error:
        assert re.match(r"[A-Za-z]\w*: \S", str(error)) and "\n" not in str(error), (what, str(error))


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("wrong", ["nan", "inf", "-1", "x", "1e400", "99999", "0", "2.5", ""])
def test_any_wrong_word_is_refused_by_field(tmp_path: Path, name: str, wrong: str) -> None:
    words = re.split(r"(\s+)", TEXTS[name])
    for k in range(0, len(words), 2):
        (tmp_path / name).write_text("".join([*words[:k], wrong, *words[k + 1 :]]))
        refuses(tmp_path / name, f"{wrong} for word {k}")


STEP = rw.Problem.balance(
    np.diag([1.0, 2.0]), [0.1, -1.0], np.array([[0.0, 1.0], [1.0, 0.0]]), [0.0, 0.0], [0.5], directions=2,
    S=[[1.0, 0.0]], w_s=[0.1],
)  # fmt: skip
DAMAGE: dict[str, Callable[[np.ndarray], object]] = {
    "nan": lambda value: np.full(value.shape, np.nan),
    "short": lambda value: np.ravel(value)[:-1],
    "negative": lambda value: -np.abs(value) - 1.0,
    "beyond": lambda value: value + 1000.0,
    "deeper": lambda value: value[None, None],
    "text": lambda _: "hello",
    "nothing": lambda _: np.zeros(0),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("form", ["local", "global", "step"])
def test_a_damaged_fclib_file_is_refused_by_field(tmp_path: Path, form: str) -> None:
    import h5py

    file = tmp_path / "a.hdf5"
    if form == "step":
        step = allocate_problem(2, 1, 1)
        step.H[:], step.W[:] = np.eye(2), np.eye(2)
        rw.write_fclib(file, step)
    else:
        rw.write_fclib(file, STEP if form == "global" else rw.Problem.local(W, [-1.0, 0.3, 0.2], [0.4]))
    whole = file.read_bytes()
    places: list[str] = []
    with h5py.File(file) as opened:
        opened.visit(places.append)
    assert len(places) > 10
    for place in places:
        for how in ("missing", "group", *DAMAGE):
            file.write_bytes(whole)
            with h5py.File(file, "r+") as opened:
                item = opened[place]
                value = item[()] if isinstance(item, h5py.Dataset) else None
                if how in DAMAGE and not isinstance(value, np.ndarray):
                    continue
                del opened[place]
                if how == "group":
                    opened[f"{place}/inner"] = 1.0
                elif how != "missing":
                    opened[place] = DAMAGE[how](np.asarray(value, float))
            refuses(file, f"{how} {place}")
    for length in range(0, len(whole), len(whole) // 40):
        file.write_bytes(whole[:length])
        refuses(file, f"cut at {length}")


@pytest.mark.parametrize(
    ("place", "value", "field"),
    [
        ("spacedim", np.array([5]), "spacedim"),
        ("vectors/q", np.array([1j, 0.0, 0.0]), "q"),
        ("W/nz", np.array([99]), "W"),
        ("V/m", np.array([3]), "s"),
    ],
)
def test_what_a_file_would_lose_is_refused_by_field(
    tmp_path: Path, place: str, value: np.ndarray, field: str
) -> None:
    import h5py

    file = tmp_path / "a.hdf5"
    rw.write_fclib(file, rw.Problem.local(W, [-1.0, 0.3, 0.2], [0.4]))
    with h5py.File(file, "r+") as opened:
        if f"fclib_local/{place}" in opened:
            del opened[f"fclib_local/{place}"]
        opened[f"fclib_local/{place}"] = value
    with pytest.raises(ValueError, match=f"^{field}: "):
        read_problem(file)


def test_a_damaged_archive_is_refused_by_field(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    with file.open("wb") as opened:
        np.savez(opened, G=np.eye(3), g=np.array([0.0, 0.0, -1.0]), mus=np.array([0.5]))
    assert rw.solve(read_problem(file)).status == "solved"
    whole = file.read_bytes()
    with file.open("wb") as opened:
        np.savez(opened, G=np.eye(3), g=np.array([0.0, 0.0, np.nan]), mus=np.array([0.5]))
    with pytest.raises(ValueError, match=r"^g: entry 2"):
        read_problem(file)
    rng = np.random.default_rng(0)
    for _ in range(200):
        damaged = bytearray(whole)
        damaged[int(rng.integers(4, len(whole)))] = int(rng.integers(256))
        file.write_bytes(bytes(damaged))
        refuses(file, "a byte")
    for length in range(4, len(whole), 25):
        file.write_bytes(whole[:length])
        refuses(file, f"cut at {length}")


NAN, INF = float("nan"), float("inf")


def damaged(
    form: type, *, indices: tuple[int, ...] = (0, 1, 2), starts: tuple[int, ...] = (0, 1, 2, 3)
) -> object:
    """A sparse (3, 3) matrix whose indices were written over."""
    made = form(np.eye(3))
    made.indices, made.indptr = np.array(indices), np.array(starts)
    return made


MASKED = np.ma.array([1.0, 2.0, 3.0], mask=[True, False, False])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: rw.Problem.lcp([[NAN]], [1.0]), "M"),
        (lambda: rw.Problem.lcp([[1.0, 2.0]], [1.0]), "M"),
        (lambda: rw.Problem.lcp([[1j]], [1.0]), "M"),
        (lambda: rw.Problem.lcp([[1.0]], [INF]), "q"),
        (lambda: rw.Problem.mlcp(np.eye(2), [1.0, 2.0], "ab"), "complementary"),
        (lambda: rw.Problem.mlcp(np.eye(2), [1.0, 2.0], [2, 0]), "complementary"),
        (lambda: rw.Problem.boxes(np.eye(2), [1.0, 2.0], [1.0, 0.0], [0.0, 1.0]), "lower"),
        (lambda: rw.Problem.boxes(np.eye(2), [1.0, 2.0], [0.0, 0.0], [1.0]), "upper"),
        (lambda: rw.Problem.local(np.eye(3), MASKED, [0.5]), "q"),
        (lambda: rw.Problem.local(np.ma.masked_equal(np.eye(3), 0.0), [1.0, 2.0, 3.0], [0.5]), "W"),
        (lambda: rw.Problem.boxes(np.eye(3), [1.0, 2.0, 3.0], -MASKED, [4.0] * 3), "lower"),
        (lambda: rw.solve(rw.Problem.lcp(np.eye(3), [1.0, 2.0, 3.0]), start=MASKED), "start"),
        (lambda: rw.Problem.lcp([[10**400]], [1.0]), "M"),
        (lambda: rw.Problem.lcp([[1.0]], [10**400]), "q"),
        (lambda: rw.Problem.lcp(damaged(sp.csr_array, indices=(0, 99, 2)), [1.0, 2.0, 3.0]), "M"),
        (lambda: rw.Problem.lcp(damaged(sp.csc_array, indices=(0, -9, 2)), [1.0, 2.0, 3.0]), "M"),
        (lambda: rw.Problem.lcp(damaged(sp.csr_array, starts=(0, 1, 2, 9)), [1.0, 2.0, 3.0]), "M"),
        (lambda: rw.Problem.local(np.eye(3), [1.0, 2.0, 3.0], [-0.1]), "mu"),
        (lambda: rw.Problem.local(np.eye(3), [1.0, 2.0, 3.0], [NAN]), "mu"),
        (lambda: rw.Problem.local(np.eye(3), [1.0, 2.0], [0.5]), "q"),
        (lambda: rw.Problem.local(np.eye(1), [1.0], [0.5], directions=True), "directions"),
        (lambda: rw.Problem.local(np.eye(3), [1.0, 2.0, 3.0], [0.5], directions=4), "directions"),
        (lambda: rw.Problem.balance(np.eye(2), [1.0], np.eye(2), [0.0, 0.0], [0.5], directions=2), "H"),
        (lambda: rw.Problem.balance([[1.0]], [1.0], [], [], [], S=[[1.0]], w_s=[0.0]), "W"),
        (lambda: rw.Problem(np.eye(2), [1.0, 2.0], lower=[0, 0], upper=[1, 1], velocities="a"), "velocities"),
        (lambda: rw.solve(3), "problem"),
        (lambda: rw.solve(STEP, tol="small"), "tol"),
        (lambda: rw.solve(STEP, tol=NAN), "tol"),
        (lambda: rw.solve(STEP, tol=None), "tol"),
        (lambda: rw.solve(STEP, tol=[1e-9]), "tol"),
        (lambda: rw.Problem.local(sp.csr_array(1j * np.eye(3)), [1.0, 2.0, 3.0], [0.5]), "W"),
        (lambda: rw.Problem.local(1j * np.eye(3), [1.0, 2.0, 3.0], [0.5]), "W"),
        (lambda: rw.Problem.local(np.eye(3), np.array([1j, 2.0, 3.0]), [0.5]), "q"),
        (lambda: rw.Problem.local(np.eye(3), [1.0, 2.0, 3.0], [0.5], directions=3.0), "directions"),
        (lambda: rw.Problem.local(np.eye(3), [1.0, 2.0, 3.0], [0.5], directions=np.zeros(2)), "directions"),
        (lambda: rw.extreme_motions(rw.solutions(STEP), [[True]]), "objects"),
        (lambda: rw.solve(STEP, start=[NAN] * 5), "start"),
        (lambda: rw.solutions("a.hdf5"), "problem"),
        (lambda: rw.solutions(STEP, nodes=1.5), "nodes"),
        (lambda: rw.extreme_motions(STEP), "found"),
        (lambda: rw.extreme_motions(rw.solutions(STEP), objects=[0, 1]), "objects"),
        (lambda: rw.extreme_motions(rw.solutions(STEP), objects=[["a"]]), "objects"),
        (lambda: rw.sensitivity(STEP, rw.solve(STEP)), "problem, solution"),
    ],
)
def test_wrong_problems_are_refused_by_field(make: Callable[[], object], field: str) -> None:
    with pytest.raises(ValueError, match=rf"^{field}: ") as refused:
        make()
    assert "\n" not in str(refused.value)


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
    rw.solve(problem).save(str(tmp_path / "t.npz"))
    assert (tmp_path / "t.npz").read_bytes() == out.read_bytes()
    for nowhere in ("", ".", str(tmp_path)):
        assert run(monkeypatch, str(file), "--out", nowhere) == 2
        assert re.fullmatch(r"rungwise: out: .*\n", capsys.readouterr().err)
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
