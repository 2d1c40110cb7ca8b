"""Batches on the workers of a dask scheduler: this machine's or others', reached by its address.

A batch is cut into tasks of about `TASK_S`. The scheduler gives the tasks of a worker that dies to others.
Runs do not depend on how they are cut, so the answers equal the answers of one process. What a batch is, its
maker says: a function of a module, of texts (the job), that returns the function from points to answers.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent import futures
from contextlib import contextmanager, suppress
from functools import lru_cache
from threading import get_ident
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rungwise.compilation.cache import cache_folder
from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals

if TYPE_CHECKING:
    from distributed import Client, Future

TASK_S = 0.3
"""Seconds of a task: beside them the scheduler's time, about a millisecond, does not count."""
FIRST_TASK, MOST = 32, 4096
"""Runs of a task before the time of a run is known, and at most."""
CONNECT_S, PATIENCE_S, POLL_S = 5.0, 15.0, 1.0
"""How long to try to reach the scheduler, to go on without any worker, and between two looks for workers."""

LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")
"""Loggers to silence, with the loggers below them: they print pages where an error of ours prints a line."""

Answer: TypeAlias = tuple[int, Ints, Reals]
"""Number of a batch, outcomes and margins of its runs."""
Batch: TypeAlias = "Callable[[Reals], tuple[Ints, Reals]]"
"""From points (m, d) to outcomes and margins (m,)."""
Maker: TypeAlias = "Callable[..., Batch]"


class Cluster:
    """Runs batches on a scheduler's workers: `make(*job)` makes one there. Errors are of the type `error`,
    with a `note`: when there is no worker, or none is left."""

    in_time = False

    def __init__(
        self, address: str, make: Maker, job: tuple[str, ...], error: type[InputError], note: str = ""
    ) -> None:
        self.address, self._error, self._note = address, error, note
        self._job = make, job, version()
        self._client = _connect(address, error)
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
        """Run batches of points (m, d); each answer as soon as it is known, in any order. `on_progress` is
        called with the number of runs done beyond the answers given."""
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
                    if not left[number]:
                        done -= len(batches[number])
                        yield number, outcomes[number], margins[number]
                on_progress(done)
        finally:
            with suppress(self._error), self._asking():
                self._client.cancel(list(waiting))

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Raise the error when the connection is lost."""
        try:
            yield
        except (OSError, asyncio.CancelledError, futures.CancelledError) as error:
            raise self._error(f"cluster: the scheduler at {self.address} is gone{self._note}") from error

    def _tasks(self, batches: Sequence[Reals]) -> Iterator[tuple[int, slice]]:
        """Parts of batches, of a size that is set anew for each."""
        for number, points in enumerate(batches):
            at = 0
            while at < len(points):
                end = min(at + self._size, len(points))
                yield number, slice(at, end)
                at = end

    def _threads(self) -> int:
        """How many tasks can run at once. Raises the error when there has been no worker for some time."""
        with self._asking():
            threads = int(sum(self._client.nthreads().values()))
        if threads:
            self._seen = time.monotonic()
        elif time.monotonic() > self._seen + PATIENCE_S:
            raise self._error(f"cluster: no worker at {self.address} for {PATIENCE_S:g} s{self._note}")
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
        if isinstance(error, InputError):
            raise self._error(str(error))
        if error is not None:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise self._error(f"cluster: a worker failed, {reason}{self._note}")
        with self._asking(), suppress(TimeoutError):
            outcome, margin, seconds = future.result(timeout=POLL_S)
            self._learn(len(outcome), seconds)
            return outcome, margin
        return None

    def _learn(self, runs: int, seconds: float) -> None:
        """Set the size of the next tasks, from the time of one task."""
        self._size = int(np.clip(runs * TASK_S / max(seconds, 1e-9), 1, min(MOST, 4 * self._size)))


def version() -> str:
    """Mark of the code that runs depend on: the sources of the compiled loop, and numba."""
    return cache_folder("rungwise.simulation.planar.samples").name


def work(make: Maker, job: tuple[str, ...], wanted: str, points: Reals) -> tuple[Ints, Reals, float]:
    """On a worker: outcomes and margins at points, and the seconds that they took. Raises InputError."""
    if version() != wanted:
        raise InputError("cluster: a worker has another version of rungwise or numba; install the same one")
    batch = _batch(make, job, get_ident())
    began = time.perf_counter()
    outcome, margin = batch(points)
    return outcome, margin, time.perf_counter() - began


@lru_cache(maxsize=32)
def _batch(make: Maker, job: tuple[str, ...], _thread: int) -> Batch:
    """The batch of a worker's thread, made once."""
    return make(*job)


def _connect(address: str, wrong: type[InputError]) -> Client:
    try:
        from distributed import Client
    except ImportError:
        raise wrong("cluster: needs dask.distributed (pip install 'rungwise[cluster]')") from None
    try:
        return Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise wrong(f"cluster: no scheduler answers at {address!r} ({reason})") from None
