"""Screenshots of pages in docs, drawn anew: the page of runs, and the page of sets.

    python docs/screenshots.py [FOLDER]     after a change of a page; into this folder where none is given

Needs Chromium or Chrome on the PATH.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import rungwise as rw

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import browser as driver

WIDE = 1160
"""Pixels: a page shows its parts side by side, and its letters are still read where pictures are 800 wide."""
DRAWN = "new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"


def runs(file: Path) -> None:
    """Two fingers on each rung: with an elastic impact, the dynamic rigid one throws the part off."""
    values = {"v2": 0.55, "restitution": 1.0}
    rw.view([rw.simulate("two_finger", rung, parameters=values) for rung in rw.LADDER[1:]], html=file)


def sets(file: Path) -> None:
    """The sets of the two fingers' speeds and friction on each rung."""
    over, box = ("v1", "v2", "mu"), {"mu": (0.0, 0.9)}
    rw.view([rw.feasible_set("two_finger", rung, over, box=box) for rung in rw.LADDER[1:]], html=file)


PAGES: dict[str, tuple[Callable[[Path], None], float]] = {
    "run_page": (runs, 0.866),
    "sets_page": (sets, 0.75),
}
"""Each page, and the part of the time of its runs that its screenshot shows."""


def main(arguments: Sequence[str]) -> int:
    """Write the screenshots; returns the exit code."""
    folder = Path(arguments[0]) if arguments else Path(__file__).parent
    program = driver.find()
    if program is None:
        print(f"no browser: none of {', '.join(driver.NAMES)} is on the PATH", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as draft:
        for name, (make, part) in PAGES.items():
            page = Path(draft) / f"{name}.html"
            make(page)
            shoot(program, page, folder / f"{name}.png", part)
            print(f"{folder / name}.png")
    return 0


def shoot(program: str, page: Path, file: Path, part: float) -> None:
    """The whole page as PNG, at a part of the time of its runs."""
    with driver.Browser(program, (WIDE, 900)) as browser:
        browser.open(page)
        browser.evaluate(f"play(false), seek({part} * end()), redraw(true), {DRAWN}.then(() => {DRAWN})")
        for _ in range(3):  # the height of the stage depends on that of the window
            high = browser.evaluate(f"{DRAWN}.then(() => document.body.scrollHeight)")
            size = {"width": WIDE, "height": high, "deviceScaleFactor": 1, "mobile": False}
            browser.call("Emulation.setDeviceMetricsOverride", **size)
        browser.evaluate(f"redraw(true), {DRAWN}.then(() => {DRAWN})")
        browser.screenshot(file)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
