"""Batches on the workers of a dask scheduler: this machine's or others', reached by its address.

A batch is cut into tasks of about `TASK_S`. The scheduler gives the tasks of a worker that dies to others.
Runs do not depend on how they are cut, so the answers equal the answers of one process.
"""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent import futures
from contextlib import contextmanager, suppress
from functools import lru_cache
from threading import get_ident
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.compilation.cache import cache_folder
from rungwise.kernel import Ints, Reals
from rungwise.scene import Scene, load
from rungwise.sets.asker import KEPT, Answer, InProcess, Runner
from rungwise.sets.motions import Motions
from rungwise.sets.request import batch_of
from rungwise.sets.store import SetError
from rungwise.simulation.options import moving_rung

if TYPE_CHECKING:
    from distributed import Client, Future

TASK_S = 0.3
"""Seconds of a task: beside them the scheduler's time, about a millisecond, does not count."""
FIRST_TASK = 32
"""Runs of a task before the time of a run is known."""
CONNECT_S, PATIENCE_S, POLL_S = 5.0, 15.0, 1.0
"""How long to try to reach the scheduler, to go on without any worker, and between two looks for workers."""

LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")
"""Loggers to silence, with the loggers below them: they print pages where an error of ours prints a line."""
KEPT_NOTE = "; with a folder for results, finished batches are kept, and it can be resumed"


class Cluster:
    """Runs batches on a scheduler's workers. Raises SetError when there is no worker, or none is left."""

    def __init__(self, address: str, scene: Scene, request: Mapping[str, Any]) -> None:
        self.address = address
        self._job = scene.file.model_dump_json(), json.dumps(dict(request)), version()
        self._client = _connect(address)
        self._levels = {logger: logger.level for logger in map(logging.getLogger, LOGGERS)}
        for logger in self._levels:
            logger.setLevel(logging.CRITICAL)
        self._size = FIRST_TASK
        self._seen = time.monotonic()

    def close(self) -> None:
        """Leave the scheduler."""
        self._client.close()
        for logger, level in self._levels.items():
            logger.setLevel(level)

    def answers(self, batches: Sequence[Reals], on_progress: Callable[[int], None]) -> Iterator[Answer]:
        """Run batches as `Runner.answers` does."""
        outcomes = [np.zeros(len(points), np.int64) for points in batches]
        margins = [np.zeros(len(points)) for points in batches]
        left = Counter({number: len(points) for number, points in enumerate(batches)})
        tasks, waiting, done = self._tasks(batches), dict[Any, tuple[int, slice]](), 0
        try:
            while any(left.values()):
                for _, (number, part) in zip(range(2 * self._threads() - len(waiting)), tasks, strict=False):
                    with self._asking():
                        future = self._client.submit(work, *self._job, batches[number][part], pure=False)
                    waiting[future] = number, part
                for future in self._finished(waiting):
                    answer = self._result(future)
                    if answer is None:
                        continue
                    number, part = waiting.pop(future)
                    outcomes[number][part], margins[number][part] = answer
                    left[number] -= part.stop - part.start
                    done += part.stop - part.start
                    on_progress(done)
                    if not left[number]:
                        done -= len(batches[number])
                        yield number, outcomes[number], margins[number]
        finally:
            with suppress(SetError), self._asking():
                self._client.cancel(list(waiting))

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Raise SetError when the connection is lost."""
        try:
            yield
        except (OSError, asyncio.CancelledError, futures.CancelledError) as error:
            raise SetError(f"cluster: the scheduler at {self.address} is gone{KEPT_NOTE}") from error

    def _tasks(self, batches: Sequence[Reals]) -> Iterator[tuple[int, slice]]:
        """Parts of batches, of a size that is set anew for each."""
        for number, points in enumerate(batches):
            at = 0
            while at < len(points):
                end = min(at + self._size, len(points))
                yield number, slice(at, end)
                at = end

    def _threads(self) -> int:
        """How many tasks can run at once. Raises SetError when there has been no worker for some time."""
        with self._asking():
            threads = int(sum(self._client.nthreads().values()))
        if threads:
            self._seen = time.monotonic()
        elif time.monotonic() > self._seen + PATIENCE_S:
            raise SetError(f"cluster: no worker at {self.address} for {PATIENCE_S:g} s{KEPT_NOTE}")
        return threads

    def _finished(self, waiting: Mapping[Future[Any], object]) -> Sequence[Future[Any]]:
        """Futures that have ended; none after a while."""
        from distributed import wait

        if not waiting:
            time.sleep(POLL_S)
            return ()
        with self._asking(), suppress(TimeoutError):
            return list(wait(list(waiting), timeout=POLL_S, return_when="FIRST_COMPLETED").done)
        return ()

    def _result(self, future: Future[Any]) -> tuple[Ints, Reals] | None:
        """Outcomes and margins; None when their worker is gone, and another makes them anew."""
        error = future.exception() if future.status == "error" else None
        if isinstance(error, SetError):
            raise error
        if error is not None:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise SetError(f"cluster: a worker failed, {reason}{KEPT_NOTE}")
        with self._asking(), suppress(TimeoutError):
            outcome, margin, seconds = future.result(timeout=POLL_S)
            self._learn(len(outcome), seconds)
            return outcome, margin
        return None

    def _learn(self, runs: int, seconds: float) -> None:
        """Set the size of the next tasks, from the time of one task."""
        self._size = int(np.clip(runs * TASK_S / max(seconds, 1e-9), 1, min(KEPT, 4 * self._size)))


@contextmanager
def runner(batch: Motions, address: str | None, scene: Scene, request: Mapping[str, Any]) -> Iterator[Runner]:
    """The threads of this process, or the workers of the scheduler at an address."""
    if address is None:
        yield InProcess(batch)
        return
    cluster = Cluster(address, scene, request)
    try:
        yield cluster
    finally:
        cluster.close()


def version() -> str:
    """Mark of the code that runs depend on: the sources of the compiled loop, and numba."""
    return cache_folder("rungwise.simulation.planar.samples").name


def work(scene: str, request: str, wanted: str, points: Reals) -> tuple[Ints, Reals, float]:
    """On a worker: outcomes and margins at points, and the seconds that they took. Raises SetError."""
    if version() != wanted:
        raise SetError("cluster: a worker has another version of rungwise or numba; install the same one")
    batch = _batch(scene, request, get_ident())
    began = time.perf_counter()
    found = batch.run(points)
    return found.outcome, found.margin, time.perf_counter() - began


@lru_cache(maxsize=32)
def _batch(scene: str, request: str, _thread: int) -> Motions:
    """The batch of a worker's thread, made once, its kernels compiled."""
    asked = json.loads(request)
    rung = moving_rung(asked["model"])
    rung = rung if rung.metric else rung.with_inertia(asked["inertia"])
    batch = batch_of(load(json.loads(scene)), rung, asked["over"], asked, threads=1)
    batch.run(np.mean(asked["box"], axis=1)[None, :])
    return batch


def _connect(address: str) -> Client:
    try:
        from distributed import Client
    except ImportError:
        raise SetError("cluster: needs dask.distributed (pip install 'rungwise[cluster]')") from None
    try:
        return Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise SetError(f"cluster: no scheduler answers at {address!r} ({reason})") from None
