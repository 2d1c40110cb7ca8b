"""Small deliberate faults in central files, and whether the nearest tests see them.

    python benchmarks/mutants.py [NAME ...] [--limit SECONDS] [--anew] [--out FILE]

Each fault of `faults.py` is put into a copy of the tree, alone, and the tests that it names are run there. A
fault is *killed* where a test fails, *survived* where all pass, and ended by a *timeout* where they take
longer than the limit. It is *void* where its tests fail without it, or do not begin with it. Verdicts are
written to a file after each fault; a verdict is taken from there as long as the fault, its file and its tests
are as they were. Exit code 1 where more than one in ten survive, or a fault is void.

Tools that make faults by rule (mutmut, cosmic-ray) do not fit compiled kernels: they switch faults on in a
process that runs, where kernels are machine code already, and every fault low down takes a minute or two of
compilation, so that thousands of faults of little worth cannot be had. These here are chosen, and the tests
of many run without compilation (`plain`).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from faults import FAULTS, Fault

ROOT = Path(__file__).parents[1]
COPIED = ("src", "tests", "benchmarks", "examples", "pyproject.toml")
KILLED, SURVIVED, TIMEOUT, VOID = "killed", "survived", "timeout", "void"
PASSED, FAILED = 0, 1
"""Exit codes of pytest."""
ALLOWED = 0.1
"""Part of the faults that may survive."""


@dataclass
class Verdict:
    """What came of a fault: in seconds, and of which state of the tree."""

    verdict: str
    seconds: float
    of: str


def digest(tree: Path, fault: Fault) -> str:
    """Mark of a fault, its file and its tests."""
    files = [tree / fault.file, *(tree / test.partition("::")[0] for test in fault.tests)]
    parts = [repr(fault).encode(), *(file.read_bytes() for file in files)]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:16]


def copied(folder: Path) -> Path:
    """A copy of what tests need, without compiled Python."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__", "out"))
        else:
            shutil.copy(source, folder / name)
    return folder


def faulty(tree: Path, fault: Fault) -> str:
    """Put a fault into the tree; returns the text of its file as it was. Raises ValueError where the fault's
    place is not there once."""
    file = tree / fault.file
    text = file.read_text("utf-8")
    if text.count(fault.old) != 1:
        raise ValueError(f"{fault.name}: {fault.file} has its place {text.count(fault.old)} times")
    file.write_text(text.replace(fault.old, fault.new), "utf-8")
    return text


def tested(tree: Path, fault: Fault, limit: float) -> int | None:
    """Exit code of the tests of a fault in the tree; None where they take longer than the limit."""
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["NUMBA_DISABLE_JIT"] = "1" if fault.plain else "0"
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *fault.tests]
    process = subprocess.Popen(
        command, cwd=tree, env=environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        return process.wait(limit)
    except subprocess.TimeoutExpired:
        return None
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def judged(tree: Path, fault: Fault, limit: float, sound: set[tuple[object, ...]]) -> str:
    """The verdict of a fault; `sound` are the tests, and how they are run, that pass without any fault."""
    tests = (*fault.tests, fault.plain)
    if tests not in sound:
        if tested(tree, fault, limit) != PASSED:
            return VOID
        sound.add(tests)
    text = faulty(tree, fault)
    try:
        code = tested(tree, fault, limit)
    finally:
        (tree / fault.file).write_text(text, "utf-8")
    if code is None:
        return TIMEOUT
    # Killed by a signal is killed: a wrong index in compiled code is not always an exception.
    return SURVIVED if code == PASSED else KILLED if code == FAILED or code < 0 else VOID


def run(chosen: Iterable[Fault], file: Path, limit: float, anew: bool) -> dict[str, Verdict]:
    """Verdicts by name; each is kept in the file at once."""
    kept = json.loads(file.read_text("utf-8")) if file.exists() else {}
    known, verdicts = {name: Verdict(**values) for name, values in kept.items()}, dict[str, Verdict]()
    sound = set[tuple[object, ...]]()
    with tempfile.TemporaryDirectory(prefix="rungwise-mutants-") as folder:
        tree = copied(Path(folder))
        for fault in chosen:
            mark = digest(tree, fault)
            if anew or fault.name not in known or known[fault.name].of != mark:
                began = time.monotonic()
                verdict = judged(tree, fault, limit, sound)
                known[fault.name] = Verdict(verdict, round(time.monotonic() - began, 1), mark)
                file.parent.mkdir(parents=True, exist_ok=True)
                draft = file.with_suffix(".draft")
                draft.write_text(json.dumps({name: asdict(each) for name, each in known.items()}, indent=1))
                draft.replace(file)
            verdicts[fault.name] = known[fault.name]
            print(row(fault, known[fault.name]), flush=True)
    return verdicts


def row(fault: Fault, found: Verdict) -> str:
    """One line of the table."""
    place = fault.file.removeprefix("src/rungwise/")
    return f"{found.verdict:8} {found.seconds:6.1f} s  {fault.name:30} {place}: {fault.wrong}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="faults to try; all if none is named")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for the tests of a fault")
    parser.add_argument("--anew", action="store_true", help="try faults again whose verdict is known")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "mutants.json", help="file of verdicts")
    options = parser.parse_args()
    by_name = {fault.name: fault for fault in FAULTS}
    unknown = [name for name in options.names if name not in by_name]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; known are {', '.join(by_name)}")
    chosen = [by_name[name] for name in options.names or by_name]
    for ending in (signal.SIGINT, signal.SIGTERM):  # ends the tests that run, too, and takes the copy away
        signal.signal(ending, signal.default_int_handler)
    try:
        verdicts = run(chosen, options.out, options.limit, options.anew)
    except KeyboardInterrupt:
        print(f"interrupted; verdicts so far are in {options.out}", file=sys.stderr)
        return 130
    counts = Counter(found.verdict for found in verdicts.values())
    parts = ", ".join(f"{counts[verdict]} {verdict}" for verdict in (KILLED, SURVIVED, TIMEOUT, VOID))
    print(f"{len(verdicts)} faults: {parts}")
    return int(counts[VOID] > 0 or counts[SURVIVED] > ALLOWED * len(verdicts))


if __name__ == "__main__":
    sys.exit(main())
