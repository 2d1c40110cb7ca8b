"""Solvers of other projects in processes of their own: some of them end the process, some do not end.

A peer is a script that calls `serve`, run by the Python that has the other project; it needs numpy only.
`Peer` starts it and asks: each question is answered by a fork of it, which is ended at its limit.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ENOUGH, BATCH, BATCHES = 0.1, 2e-3, 5
"""Seconds beyond which a solve is not repeated; others are timed in so many batches of at least so long."""
FIRST = 5e-3
"""Seconds that the first solve may lose to pages and symbols that no later one waits for."""
PATIENCE = 12.0
"""Wall-clock over processor seconds that a question may take: the machine may be shared."""

Task = dict[str, Any]


@dataclass(frozen=True)
class Answer:
    """Seconds of one solve, the forces (n,), whether the solver says that it converged, and the seconds of
    what it has to do once per problem before it."""

    seconds: float
    forces: NDArray[np.float64]
    converged: bool
    preparation: float = 0.0


class Peer:
    """A running peer; close it with `with`."""

    def __init__(self, python: str, script: str, *arguments: str) -> None:
        self._folder = tempfile.TemporaryDirectory()
        single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [python, script, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | single,
        )

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.communicate()
        self._folder.cleanup()

    def ask(self, task: Task, limit: float) -> tuple[Answer | None, float]:
        """The answer, none if the solver fails or takes more than `limit` seconds; the seconds it took."""
        out = Path(self._folder.name) / "answer.npz"
        out.unlink(missing_ok=True)
        assert self._process.stdin is not None and self._process.stdout is not None
        print(json.dumps(task | {"limit": limit, "out": str(out)}), file=self._process.stdin, flush=True)
        spent = self._process.stdout.readline()
        if not spent:
            raise OSError(f"{self._process.args}: ended")
        if not out.exists():
            return None, float(spent)
        with np.load(out) as told:
            answer = Answer(
                float(told["seconds"]), told["forces"], bool(told["converged"]), float(told["preparation"])
            )
        return answer, float(spent)


def serve(solve: Callable[[Task], Answer]) -> None:
    """Answer the questions of a `Peer` until it closes; whatever solvers print is dropped."""
    # Some have their matrices on the stack.
    most = resource.getrlimit(resource.RLIMIT_STACK)[1]
    resource.setrlimit(resource.RLIMIT_STACK, (most, most))
    told = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            # Some wait for a key.
            os.dup2(nowhere, 0)
            try:
                _answer(solve, json.loads(line))
            finally:
                os._exit(0)
        used = os.wait4(child, 0)[2]
        print(used.ru_utime + used.ru_stime, file=told, flush=True)


def _answer(solve: Callable[[Task], Answer], task: Task) -> None:
    # Beside this timer the clock of the process is coarse; that of the thread is not.
    signal.setitimer(signal.ITIMER_PROF, task["limit"])
    signal.setitimer(signal.ITIMER_REAL, PATIENCE * task["limit"])
    answer = solve(task)
    part = f"{task['out']}.part.npz"
    np.savez(part, **asdict(answer))
    os.replace(part, task["out"])


def typical(batch: Callable[[int], float], slow: float) -> float:
    """Median seconds of a solve, or of one beyond `slow` its only time; batch(n) is the time of n."""
    first = batch(1)
    if first > min(slow + FIRST, ENOUGH):
        return first
    times = max(1, round(BATCH / first))
    return statistics.median(batch(times) / times for _ in range(BATCHES))
