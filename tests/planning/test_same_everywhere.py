"""The same seed gives the same plan, bit for bit, whatever else the machine does."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

PLANNED = """
import sys, hashlib
import rungwise as rw
for name in sys.argv[2:]:
    plan = rw.plan(name, seed=1, threads=int(sys.argv[1]), limit=900.0)
    assert plan.found, plan.reason
    text = repr([(each.inputs, each.duration, each.until, each.ramp) for each in plan.segments])
    print(name, hashlib.sha256(text.encode() + plan.moves.tobytes()).hexdigest())
"""
BUSY = 4


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that do other work."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def planned(names: tuple[str, ...], threads: int, seed: str, beside: int = 0) -> list[str]:
    """Digests of plans that another process made, with this seed of hashes."""
    with busy(beside):
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", PLANNED, str(threads), *names],
            env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True,
        )  # fmt: skip
    return done.stdout.splitlines()


@pytest.mark.parametrize(
    "names",
    [
        ("card", "floor_push"),
        pytest.param(("push", "corner_pivot", "planar_hand"), marks=pytest.mark.long, id="plane"),
        pytest.param(("floor_push", "door", "hand_turn"), marks=pytest.mark.long, id="space"),
    ],
    ids=str,
)
def test_plans_depend_on_nothing_but_their_seed(
    names: tuple[str, ...], request: pytest.FixtureRequest
) -> None:
    """Neither on threads, nor on the order of hashes, nor on what runs beside them."""
    one, two = planned(names, 1, "1"), planned(names, 2, "2")
    assert len(one) == len(names) and one == two
    if request.node.get_closest_marker("long"):
        assert planned(names, 2, "3", beside=BUSY) == one
