"""Sets whose runs are done by workers of a dask scheduler on the loopback, some of which die."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise import cluster as module

pytest.importorskip("distributed", reason="needs the extra cluster (dask.distributed)")
BOX = {"v1": (0.2, 2.2), "v2": (0.2, 2.2), "mu": (0.0, 0.9)}


class Farm:
    """A scheduler and workers without anyone who would start them again."""

    def __init__(self, folder: Path, workers: int) -> None:
        self._file = folder / "scheduler.json"
        self._folder = folder
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
            "--scheduler-file", str(self._file),
        )  # fmt: skip
        until = time.monotonic() + 60.0
        while not self._file.is_file() or not self._file.read_text().endswith("}"):
            assert time.monotonic() < until, "the scheduler does not start"
            time.sleep(0.05)
        self.address = str(json.loads(self._file.read_text())["address"])
        self.workers = [self.worker() for _ in range(workers)]

    def worker(self) -> subprocess.Popen[bytes]:
        return self._start(
            "worker", self.address, "--no-nanny", "--nthreads", "1", "--host", "127.0.0.1", "--no-dashboard"
        )

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            cwd=self._folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def stop(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[Farm]:
    made = Farm(tmp_path, 2)
    yield made
    made.stop()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    """Of tests that leave it a worker."""
    made = Farm(tmp_path_factory.mktemp("farm"), 2)
    yield made
    made.stop()


def grasp(model: rw.Rung = rw.QUASISTATIC_RIGID, **options: Any) -> rw.FeasibleSet:
    return rw.feasible_set(
        "two_finger", model, tuple(BOX), **{"box": BOX, "tol": 0.06, "threads": 1, **options}
    )


def _listen(told: list[tuple[str, int, int]]) -> Callable[[str, int, int], None]:
    return lambda *what: told.append(what)


@pytest.mark.long
@pytest.mark.parametrize(
    "model",
    [rw.DYNAMIC_RIGID.with_inertia(0.5), pytest.param(rw.DYNAMIC_COMPLIANT, marks=pytest.mark.long)],
    ids=str,
)
def test_workers_give_the_same_bytes(shared: Farm, tmp_path: Path, model: rw.Rung) -> None:
    told: list[tuple[str, int, int]] = []
    many = grasp(model, cluster=shared.address, on_progress=_listen(told), out=tmp_path)
    one = grasp(model)
    assert many.data.identical(one.data)
    done = [count for _, count, _ in told]
    assert done == sorted(done) and done[-1] == many.evaluations == told[-1][2]
    again = grasp(model, out=tmp_path, resume=True)
    assert again.data.identical(one.data)


@pytest.mark.long
def test_a_worker_that_fails_is_named(shared: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch, pytest.raises(rw.SetError, match="another version of rungwise"):
        patch.setattr(module, "version", lambda: "older")
        grasp(cluster=shared.address)
    with (
        monkeypatch.context() as patch,
        pytest.raises(rw.SetError, match="a worker failed, TypeError: listdir"),
    ):
        patch.setattr(module, "work", os.listdir)
        grasp(cluster=shared.address)


@pytest.mark.long
def test_runs_of_a_worker_that_dies_are_done_by_another(shared: Farm) -> None:
    def kill(_what: str, done: int, _known: int) -> None:
        if done > 100:
            shared.workers[0].kill()

    many = grasp(cluster=shared.address, on_progress=kill)
    assert shared.workers[0].wait() < 0
    assert many.data.identical(grasp().data)


@pytest.mark.long
def test_when_none_is_left_batches_are_kept(
    farm: Farm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 4.0)

    def kill(_what: str, done: int, _known: int) -> None:
        if done > 1000:
            for worker in farm.workers:
                worker.kill()

    with pytest.raises(rw.SetError, match=r"no worker at .* for 4 s; with a folder"):
        grasp(cluster=farm.address, on_progress=kill, out=tmp_path / "set", tol=0.03)
    assert len(list((tmp_path / "set" / "batches").iterdir())) >= 1
    farm.workers.append(farm.worker())
    found = grasp(cluster=farm.address, out=tmp_path / "set", resume=True, tol=0.03)
    assert found.data.identical(grasp(tol=0.03).data)


@pytest.mark.long
def test_when_the_scheduler_dies_it_is_one_line_and_batches_are_kept(farm: Farm, tmp_path: Path) -> None:
    process = subprocess.Popen([*command(tmp_path), "--cluster", farm.address], stderr=subprocess.PIPE)
    until_kept(process, tmp_path)
    farm.scheduler.kill()
    _, error = process.communicate(timeout=120)
    assert process.returncode == 2, error.decode()
    assert error.decode().startswith("rungwise: cluster: ") and error.count(b"\n") == 1
    found = grasp(rw.DYNAMIC_RIGID, out=tmp_path / "set" / "dynamic-rigid", resume=True)
    assert found.data.identical(grasp(rw.DYNAMIC_RIGID).data)


def command(folder: Path) -> list[str]:
    return [
        sys.executable, "-m", "rungwise", "sets", "two_finger", "--model", "dynamic-rigid", "--json",
        "--over", "v1=0.2:2.2,v2=0.2:2.2,mu=0:0.9", "--tol", "0.06", "--out", str(folder / "set"),
    ]  # fmt: skip


def until_kept(process: subprocess.Popen[bytes], folder: Path) -> None:
    """Wait until there is a finished batch."""
    batches = folder / "set" / "dynamic-rigid" / "batches"
    while process.poll() is None and not (batches.is_dir() and list(batches.iterdir())):
        time.sleep(0.01)


@pytest.mark.long
def test_a_worker_that_dies_loses_nothing(farm: Farm, tmp_path: Path) -> None:
    process = subprocess.Popen([*command(tmp_path), "--cluster", farm.address], stdout=subprocess.PIPE)
    until_kept(process, tmp_path)
    farm.workers[0].kill()
    output, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    expected = grasp(rw.DYNAMIC_RIGID)
    assert json.loads(output)["sets"][0]["evaluations"] == expected.evaluations
    assert rw.load_set(tmp_path / "set" / "dynamic-rigid").data.identical(expected.data)


@pytest.mark.long
def test_no_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    done = subprocess.run(
        [
            sys.executable, "-m", "rungwise", "sets", "two_finger", "--model", "kinematic",
            "--over", "v2", "--cluster", "nonsense",
        ],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 2 and done.stdout == ""
    assert (
        done.stderr.startswith("rungwise: cluster: no scheduler answers at") and done.stderr.count("\n") == 1
    )
    monkeypatch.setattr(module, "CONNECT_S", 0.5)
    with pytest.raises(rw.SetError, match=r"cluster: no scheduler answers at 'tcp://127\.0\.0\.1:9"):
        grasp(cluster="tcp://127.0.0.1:9")


@pytest.mark.long
def test_tasks_take_their_share_of_time() -> None:
    """The size of a task follows the time that the one before took, and every run is done once."""

    cluster = module.Cluster.__new__(module.Cluster)
    cluster._size = module.FIRST_TASK
    cluster._learn(32, 0.01)
    assert cluster._size == 4 * module.FIRST_TASK  # no faster than that
    for _ in range(5):
        cluster._learn(cluster._size, cluster._size / 1000.0)
    assert cluster._size == 300  # a thousand runs a second
    pieces = list(cluster._tasks([np.zeros((1000, 2)), np.zeros((1, 2))]))
    assert [part.stop - part.start for _, part in pieces] == [300, 300, 300, 100, 1]
