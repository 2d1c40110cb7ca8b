"""Processor time of a newcomer's first commands, from an empty cache, each in a process of its own.

    python benchmarks/start.py [--json] [--python PATH]

The cache of compiled kernels is a temporary folder; what the commands write goes there too. `again` repeats
a command with what the first one left in the cache. PATH is the interpreter of another environment, for
instance one with a wheel that brings its kernels (`make wheel`).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

LOAD = "import rungwise as rw; rw.load('two_finger')"
SIM = ("-m", "rungwise", "sim", "two_finger", "--model", "dynamic-rigid")
SETS = (
    "-m",
    "rungwise",
    "sets",
    "two_finger",
    "--model",
    "dynamic-rigid",
    "--over",
    "v1,v2",
    "--tol",
    "0.05",
)
PROBLEM = """
import numpy as np, rungwise as rw
rng = np.random.default_rng(0)
G = rng.normal(size=(12, 8))
rw.write_fclib("problem.hdf5", rw.Problem.local(G @ G.T, G @ rng.normal(size=8), np.full(4, 0.5), 3))
"""
README = (Path(__file__).parent.parent / "README.md").read_text("utf-8")
TEN_LINES = re.findall(r"^```python\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)[0]
COMMANDS = (
    ("import rungwise", ("-c", "import rungwise")),
    ("rungwise --help", ("-m", "rungwise", "--help")),
    ("import, and load two_finger", ("-c", LOAD)),
    ("first sim", SIM),
    ("sim again", SIM),
    ("first sets", SETS),
    ("sets again", SETS),
    ("first solve", ("-m", "rungwise", "solve", "problem.hdf5")),
    ("solve again", ("-m", "rungwise", "solve", "problem.hdf5")),
    ("then the README's ten lines", ("-c", TEN_LINES)),
    ("ten lines again", ("-c", TEN_LINES)),
)


def measure(python: str = sys.executable) -> dict[str, float]:
    """Seconds of processor time by command, in the order of `COMMANDS`."""
    spent = {}
    with tempfile.TemporaryDirectory() as folder:
        own = os.environ | {"RUNGWISE_CACHE": os.path.join(folder, "cache")}
        subprocess.run([python, "-c", PROBLEM], cwd=folder, check=True)
        for name, command in COMMANDS:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([python, *command], env=own, cwd=folder, capture_output=True, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent[name] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(description="Processor time of the first commands.")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--python", default=sys.executable, metavar="PATH", help="interpreter to measure")
    options = parser.parse_args(arguments)
    spent = measure(os.path.abspath(options.python))
    if options.json:
        print(json.dumps(spent))
    else:
        for name, seconds in spent.items():
            print(f"{name:30s} {seconds:6.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
