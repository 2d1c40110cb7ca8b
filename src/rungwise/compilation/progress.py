"""Tells a person who waits for compilation, at once and every four seconds, on the standard error stream."""

from __future__ import annotations

import sys
import time

SHORT_S = 0.5
"""A wait of so many seconds needs no word: chosen for a person who waits, by trial."""
EVERY_S = 4.0
"""Seconds between further words: chosen for a person who reads them, by trial."""


FIRST = "for about a minute, which counts towards no limit"
"""What is said of the first wait."""


class Progress:
    """Kernels that this process compiled, and for how long. Compilation nests, in one thread at a time."""

    def __init__(self) -> None:
        self.kernels = 0
        self._depth = 0
        self._took: tuple[float, float | None] = 0.0, None
        self._next = SHORT_S

    @property
    def waited(self) -> float:
        """Seconds of all compilation, one that goes on included; any thread may ask."""
        seconds, began = self._took
        return seconds if began is None else seconds + time.perf_counter() - began

    def tell(self, text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def begin(self) -> None:
        if self._depth == 0:
            self._took = self._took[0], time.perf_counter()
        self._depth += 1
        waited = self.waited
        if waited >= self._next:
            so_far = f"{self.kernels} so far, {waited:.0f} s" if self._next > SHORT_S else FIRST
            self.tell(f"rungwise: compiling kernels, once ({so_far})")
            self._next = (waited // EVERY_S + 1.0) * EVERY_S

    def end(self) -> None:
        self._depth = max(self._depth - 1, 0)
        self.kernels += 1
        if self._depth == 0:
            self._took = self.waited, None

    def reset(self) -> None:
        """Forget a compilation that did not end."""
        self._depth = 0
        self._took = self.waited, None


compiling = Progress()
