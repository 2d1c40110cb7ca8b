"""Tells a person who waits for compilation, at once and every four seconds, on the standard error stream."""

from __future__ import annotations

import sys
import time

SHORT_S = 0.5
"""A wait of so many seconds needs no word: chosen for a person who waits, by trial."""
EVERY_S = 4.0
"""Seconds between further words: chosen for a person who reads them, by trial."""


class Progress:
    """Kernels compiled by this process, and its seconds. Compilation nests, in one thread at a time."""

    def __init__(self) -> None:
        self.kernels = 0
        self.seconds = 0.0
        self._depth = 0
        self._began = 0.0
        self._next = SHORT_S

    def tell(self, text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def begin(self) -> None:
        now = time.perf_counter()
        if self._depth == 0:
            self._began = now
        self._depth += 1
        waited = self.seconds + now - self._began
        if waited >= self._next:
            so_far = (
                f"{self.kernels} so far, {waited:.0f} s" if self._next > SHORT_S else "for about a minute"
            )
            self.tell(f"rungwise: compiling kernels, once ({so_far})")
            self._next = (waited // EVERY_S + 1.0) * EVERY_S

    def end(self) -> None:
        self._depth = max(self._depth - 1, 0)
        self.kernels += 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began

    def reset(self) -> None:
        """Forget a compilation that did not end."""
        self._depth = 0


compiling = Progress()
