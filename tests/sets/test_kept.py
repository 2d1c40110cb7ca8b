"""What is kept when a process is killed or the disk is full, and samples that fail while the rest goes on."""

from __future__ import annotations

import errno
import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise import cli
from rungwise.compilation.progress import compiling
from rungwise.simulation import threads

OVER = "v1=0.2:2.2,v2=0.2:2.2,mu=0:0.9"
BOX = {"v1": (0.2, 2.2), "v2": (0.2, 2.2), "mu": (0.0, 0.9)}


def command(out: Path, *more: str) -> list[str]:
    return [
        sys.executable, "-m", "rungwise", "sets", "two_finger", "--model", "dynamic-rigid",
        "--over", OVER, "--tol", "0.06", "--out", str(out), *more,
    ]  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and file.suffix != ".png"
    }


def grasp(out: Path, **options: Any) -> rw.FeasibleSet:
    return rw.feasible_set(
        "two_finger", rw.QUASISTATIC_RIGID, tuple(BOX), box=BOX, threads=1, tol=0.03, out=out, **options
    )


def batches_in(folder: Path) -> int:
    """How many are kept, also while a process writes beside them (a walk passes over folders that vanish)."""
    walked = [(Path(place), files) for place, _, files in os.walk(folder)]
    return sum(
        name[0].isdigit() and name.endswith(".npz")
        for place, files in walked
        if place.name == "batches"
        for name in files
    )


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that start as copies (fork)")
def test_ten_kills_at_random_moments_lose_nothing(tmp_path: Path) -> None:
    """Each process is killed at a random moment after it has kept its first batch."""
    began = time.monotonic()
    grasp(tmp_path / "whole")
    each = (time.monotonic() - began) / batches_in(tmp_path / "whole")
    moments, kept = np.random.default_rng(0), [0]
    for _ in range(10):
        process = get_context("fork").Process(
            target=grasp, args=(tmp_path / "parts",), kwargs={"resume": True}
        )
        process.start()
        while process.is_alive() and batches_in(tmp_path / "parts") == kept[-1]:
            process.join(0.01)
        process.join(moments.uniform(0.0, 2.0) * each)
        process.kill()
        process.join()
        kept.append(batches_in(tmp_path / "parts"))
    assert kept == sorted(kept) and kept[-1] > 0
    grasp(tmp_path / "parts", resume=True)
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")


@pytest.mark.long
def test_a_command_that_is_killed_goes_on(tmp_path: Path) -> None:
    process = subprocess.Popen(command(tmp_path / "parts"), stdout=subprocess.DEVNULL)
    while batches_in(tmp_path / "parts") < 3:
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    process.wait()
    done = subprocess.run(command(tmp_path / "parts", "--resume"), check=True, capture_output=True)
    assert b"dynamic-rigid" in done.stdout
    subprocess.run(command(tmp_path / "whole"), check=True, capture_output=True)
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")


def test_a_batch_that_is_torn_is_done_again(tmp_path: Path) -> None:
    whole = grasp(tmp_path)
    files = sorted((tmp_path / "batches").iterdir())
    before = [file.read_bytes() for file in files]
    files[0].write_bytes(b"")
    files[1].write_bytes(before[1][: len(before[1]) // 2])
    (tmp_path / "batches" / ".0123abcd.npz").write_bytes(b"torn")
    (tmp_path / ".0123abcd.zarr").mkdir()
    assert grasp(tmp_path, resume=True).data.identical(whole.data)
    assert [file.read_bytes() for file in sorted((tmp_path / "batches").iterdir())] == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["batches", "request.json", "set.zarr"]


def test_a_full_disk_keeps_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = grasp(tmp_path / "whole")
    save, written = np.savez, 0

    def full(*arguments: Any, **arrays: Any) -> None:
        nonlocal written
        written += 1
        if written > 2:
            Path(arguments[0]).write_bytes(b"half")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        save(*arguments, **arrays)

    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", full)
        with pytest.raises(OSError, match="No space left"):
            grasp(tmp_path / "parts")
    names = sorted(path.name for path in (tmp_path / "parts" / "batches").iterdir())
    assert names == ["000000.npz", "000001.npz"]
    assert grasp(tmp_path / "parts", resume=True).data.identical(whole.data)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 120 kB, where that can be had."""
    folder = tmp_path / "disk"
    folder.mkdir()
    try:
        subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=120k", "tmpfs", str(folder)], check=True, capture_output=True
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("needs the right to mount a file system; the test before imitates a full one")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.long
def test_a_disk_that_is_full_is_one_line(
    small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(out: Path, *more: str) -> object:
        monkeypatch.setattr(sys, "argv", ["rungwise", *command(out, *more)[3:]])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return ended.value.code

    monkeypatch.setattr(compiling, "tell", lambda _: None)
    assert run(small_disk / "set") == 2
    failed = capsys.readouterr()
    assert failed.out == ""
    assert failed.err == (
        f"rungwise: out: {small_disk / 'set'} cannot be written (No space left on device);"
        " finished batches are kept, and --resume goes on from them\n"
    )
    assert list(small_disk.rglob("batches/[0-9]*.npz"))
    subprocess.run(["mount", "-o", "remount,size=50m", str(small_disk)], check=True)
    assert run(small_disk / "set", "--resume") == run(tmp_path / "whole") == 0
    assert contents(small_disk / "set") == contents(tmp_path / "whole")


@pytest.mark.long
def test_a_folder_that_cannot_be_written_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also for a superuser, whom permissions do not stop: a file is where the folder should be."""
    (tmp_path / "file").touch()
    targets = [tmp_path / "file" / "set"]
    if os.geteuid() != 0:
        (tmp_path / "closed").mkdir(mode=0o555)
        targets.append(tmp_path / "closed" / "set")
    for target in targets:
        for option in ("--out", "--csv", "--mesh", "--html"):
            file = {"--mesh": "set.obj"}.get(option, "set")
            arguments = ["sets", "two_finger", "--model", "kinematic", "--over", "v1,v2", "--tol", "0.1"]
            path = str(target.with_name(file))
            monkeypatch.setattr(sys, "argv", ["rungwise", *arguments, option, path])
            with pytest.raises(SystemExit) as ended:
                cli.main()
            said = [line for line in capsys.readouterr().err.splitlines() if "compiling" not in line]
            assert ended.value.code == 2 and len(said) == 1
            assert said[0].startswith(f"rungwise: {option[2:]}: ") and "cannot be written" in said[0]


def test_scenes_that_are_impossible_are_reported_and_the_rest_goes_on() -> None:
    """A disc that grows into the wall beside it: from a radius of 1 on there is no start."""
    scene = rw.load(
        {
            "name": "disc",
            "parameters": {
                "r": {"default": 0.5, "range": [0.1, 2.0]},
                "v": {"default": 1.0, "range": [0.1, 2.0]},
            },
            "bodies": {
                "disc": {
                    "role": "robot", "shape": {"kind": "disc", "radius": "r"},
                    "motion": {"kind": "slide", "axis": [0, 1], "name": "s"},
                    "coordinates": {"s": {"drive": {"kind": "speed", "speed": "v"}}},
                },
                "wall": {
                    "role": "obstacle", "pose": {"x": 1.0}, "motion": {"kind": "fixed"},
                    "shape": {"kind": "halfplane", "normal": [-1, 0]},
                },
            },
            "contacts": [{"between": ["disc", "wall"]}],
            "goal": "disc.s >= 1",
            "duration": 1.0,
            "step": 0.1,
        }
    )  # fmt: skip
    found = rw.feasible_set(scene, rw.KINEMATIC, ("r", "v"), tol=0.01, threads=1)
    points = found.random(20_000, 6)
    r, v = points.T
    expected = np.where(r > 1.0, "invalid", np.where(v >= 1.0, "feasible", "infeasible"))
    wrong = found.classify(points) != expected
    assert (np.minimum(np.abs(r - 1.0), np.abs(v - 1.0))[wrong] <= 0.01 * 1.9).all()
    assert found.volumes()["invalid"] == pytest.approx(1.0 / 1.9, abs=0.01)


def test_runs_that_do_not_converge_are_reported_and_the_rest_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of runs that may take no more steps than all but the longest need."""
    accuracy, over = 3e-3, ("v1", "v2")
    batch = rw.Batch(rw.load("two_finger"), rw.DYNAMIC_RIGID, over, tol=accuracy)
    steps = batch.run(np.random.default_rng(0).uniform(0.2, 2.2, (2000, 2))).steps
    monkeypatch.setattr(threads, "BUDGET", int(steps.max()) - 1)
    found = rw.feasible_set("two_finger", rw.DYNAMIC_RIGID, over, box=BOX, tol=0.02, accuracy=accuracy)
    parts = found.volumes()
    assert set(parts) >= {"unknown", "doomed"} and sum(parts.values()) == pytest.approx(1.0)
    monkeypatch.undo()
    whole = rw.feasible_set("two_finger", rw.DYNAMIC_RIGID, over, box=BOX, tol=0.02, accuracy=accuracy)
    assert "unknown" not in whole.volumes()
    known = found.random(5000, 7)
    known = known[found.classify(known) != "unknown"]
    agree = found.classify(known) == whole.classify(known)
    assert agree.mean() > 0.98


@pytest.mark.few(1)
@pytest.mark.parametrize("batches", [0, 1, 3])
def test_of_a_batch_that_a_limit_ends_the_runs_that_are_done_are_kept(
    batches: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The last run of each batch after so many is still going on then; it alone is made again on resuming."""
    asked: dict[str, Any] = {"tol": 0.05, "threads": 1}
    whole = rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), **asked)
    run, made = rw.Batch.run, itertools.count()

    def cut(own: rw.Batch, points: Any, **options: Any) -> rw.Results:
        found = run(own, points, **options)
        if next(made) >= batches:
            found.outcome[-1] = rw.Code.RUNNING
        return found

    with monkeypatch.context() as patch:
        patch.setattr(rw.Batch, "run", cut)
        try:
            found = rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), out=tmp_path, **asked)
            assert not found.complete and found.evaluations < whole.evaluations
        except rw.SetError as error:
            assert batches == 0 and "first cells" in str(error)
    assert len(list((tmp_path / "batches").iterdir())) == batches + 1
    sizes = list[int]()

    def count(own: rw.Batch, points: Any, **options: Any) -> rw.Results:
        sizes.append(len(points))
        return run(own, points, **options)

    monkeypatch.setattr(rw.Batch, "run", count)
    again = rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), out=tmp_path, resume=True, **asked)
    assert sizes[0] == 1
    assert again.complete and again.evaluations == whole.evaluations
    points = whole.random(500, 0)
    assert (again.labels(points) == whole.labels(points)).all()
