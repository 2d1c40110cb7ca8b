"""Processor time that work takes."""

from __future__ import annotations

import time
from collections.abc import Callable


def processor_times(work: Callable[[], object], repeats: int) -> list[float]:
    """Seconds that each of so many repeats took."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return times
