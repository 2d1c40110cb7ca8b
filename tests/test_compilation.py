"""Kernels that are compiled each on its own find one another, in another process and after accidents."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rungwise.compilation import private

HEAR = "\nfrom rungwise.compilation.progress import compiling\nprint(compiling.kernels)\n"
CALLER = """
from callee import grow, seldom
from rungwise.kernel import Reals, kernel

@kernel
def outer(x: Reals, often: bool) -> float:
    for i in range(x.shape[0]):
        x[i] = grow(x[i])
    return _total(x) if often else seldom(x)

@kernel
def _total(x: Reals) -> float:
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i]
    return total
"""
CALLEE = """
from rungwise.kernel import Reals, kernel, rare_kernel

FACTOR = 2.0

@kernel
def grow(x: float) -> float:
    return FACTOR * x

@rare_kernel
def seldom(x: Reals) -> float:
    return -grow(x[0])
"""
USE = """
import numpy as np
from caller import outer
x = np.ones(3)
print(outer(x, True), outer(x, False))
"""
THREADS = """
import numpy as np
from concurrent.futures import ThreadPoolExecutor
from caller import outer
with ThreadPoolExecutor(8) as pool:
    print(*pool.map(lambda k: outer(np.full(3, 1.0 + k), False), range(8)))
"""
STOPPED = """
import numpy as np
import caller, callee
from caller import outer
kept = callee.seldom.inside
class Broken:
    def address(self, _types):
        raise KeyboardInterrupt
callee.seldom.__dict__["inside"] = Broken()
try:
    outer(np.ones(3), False)
except KeyboardInterrupt:
    callee.seldom.__dict__["inside"] = kept
    print(outer(np.ones(3), False))
"""
MANY = """
from rungwise.kernel import Reals, Record, RecordArray, kernel

@kernel
def weigh(line: Reals, other: Reals, deep: Reals, both: tuple[Reals, tuple[Reals, float]],
          records: RecordArray, record: Record) -> tuple[float, int]:
    line[0] += 1.0
    total, (_, factor) = record.mass + records[1].mass, both[1]
    for i in range(deep.shape[0]):
        for j in range(deep.shape[1]):
            for k in range(deep.shape[2]):
                total += (1 + i + 10 * j + 100 * k) * deep[i, j, k]
    for i in range(other.shape[0]):
        total += line[i % line.size] * other[i] + factor * both[0][i, i] - both[1][0][i]
    return total, deep.size + records.shape[0]

@kernel
def hand_over(line: Reals, other: Reals, deep: Reals, both: tuple[Reals, tuple[Reals, float]],
              records: RecordArray) -> tuple[float, int]:
    return weigh(line[1:], other, deep[:, 1:], (both[0], both[1]), records, records[0])
"""
HANDED = """
import numpy as np
import many
from rungwise.kernel import record_type
rng = np.random.default_rng(0)
records = np.zeros(3, record_type("number", "mass"))
records["mass"] = 1.0, 2.0, 4.0
matrix = rng.normal(size=(4, 4))
for other in (rng.normal(size=8)[::2], rng.normal(size=4), np.frombuffer(rng.normal(size=4).tobytes())):
    given = rng.normal(size=5), other, rng.normal(size=(2, 3, 4)), (matrix.T, (matrix[0], 0.5)), records
    plain = given[0].copy()
    plain[1] += 1.0
    total, size = many.hand_over(*given)
    line, other, deep, both, _ = given
    again = many.weigh.function(line[1:] - [1, 0, 0, 0], other, deep[:, 1:], both, records, records[0])
    assert abs(total - again[0]) < 1e-12 and size == again[1] == 19, (total, size, again)
    assert (given[0] == plain).all()
    print("alike")
"""
"""A kernel hands arrays of all kinds over to another one: slices, transposed, read-only, in tuples."""
INTERRUPTED = """
import signal, time
import numpy as np
import waiting
from rungwise.kernel import steady
numbers = np.ones(3)
waiting.wait(1, 0.0)
begun = time.process_time()
waiting.wait(10**7, 0.0)
rounds = int(10**7 * 0.3 / (time.process_time() - begun))
signal.signal(signal.SIGVTALRM, signal.default_int_handler)
kernels = [waiting.first, waiting.second]
for kernel in kernels + [steady(each) for each in (waiting.third, waiting.fourth)]:
    kernel(numbers, 1, False)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.05)
    try:
        kernel(numbers, rounds, True)
    except KeyboardInterrupt:
        print("interrupted", kernel(numbers, 1, True))
"""
"""A signal comes while compiled code runs that then asks for a kernel, or for one within another. Times
are of the processor: other work does not change them."""
WAITING = """
from callee import grow, seldom
from rungwise.kernel import Reals, kernel

@kernel
def wait(rounds: int, start: float) -> float:
    for k in range(rounds):
        start = (start + k) % 7.0
    return start

@kernel
def first(x: Reals, rounds: int, asks: bool) -> float:
    waited = wait(rounds, x[1])
    return grow(x[0] + 0.0 * waited) if asks else waited

@kernel
def second(x: Reals, rounds: int, asks: bool) -> float:
    return within(x, rounds, asks)

@kernel
def third(x: Reals, rounds: int, asks: bool) -> float:
    return first(x, rounds, asks)

@kernel
def fourth(x: Reals, rounds: int, asks: bool) -> float:
    return within(x, rounds, asks)

@kernel
def within(x: Reals, rounds: int, asks: bool) -> float:
    waited = wait(rounds, x[2])
    return seldom(x) + 0.0 * waited if asks else waited
"""
PUT_OFF = """
import signal
import numpy as np
import callee
from caller import outer
from rungwise.cli.terminal import heard_at_once
signal.signal(signal.SIGINT, signal.default_int_handler)
kept = {name: getattr(callee, name).inside for name in ("grow", "seldom")}
class Loading:
    def __init__(self, name):
        self.name = name
    def address(self, types):
        signal.raise_signal(signal.SIGINT)
        print(self.name, "loaded")
        return kept[self.name].address(types)
for name in kept:
    getattr(callee, name).__dict__["inside"] = Loading(name)
    try:
        with heard_at_once():
            outer(np.ones(3), name == "grow")
    except KeyboardInterrupt:
        getattr(callee, name).__dict__["inside"] = kept[name]
        print("interrupted", outer(np.ones(3), name == "grow"))
"""
"""A signal comes while a kernel is being loaded."""
FOR_ANY_PROCESSOR = """
import os
os.environ["NUMBA_CPU_NAME"], os.environ["NUMBA_CPU_FEATURES"] = "generic", ""
"""
AS_FROM_A_WHEEL = """
import pathlib
import rungwise.compilation.cache as cache
cache._SHIPPED = pathlib.Path("shipped")
"""
Run = Callable[..., list[str]]


def begun(folder: Path, code: str) -> subprocess.Popen[str]:
    """A process that runs code beside the two modules, with a cache of its own in the folder."""
    (folder / "caller.py").write_text(CALLER)
    if not (folder / "callee.py").exists():
        (folder / "callee.py").write_text(CALLEE)
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"RUNGWISE_CACHE": str(folder / "cache"), "PYTHONPATH": paths}
    environment.pop("NUMBA_DISABLE_JIT", None)
    return subprocess.Popen(
        [sys.executable, "-c", code],
        env=environment, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def finished(folder: Path, code: str) -> list[str]:
    """Words that such a process prints."""
    out, err = begun(folder, code).communicate(timeout=120)
    assert "Traceback" not in err, err
    return out.split()


@pytest.fixture
def start(tmp_path: Path) -> Callable[[str], subprocess.Popen[str]]:
    return partial(begun, tmp_path)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return partial(finished, tmp_path)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Path]:
    """What the first process of all prints, and the cache that it leaves."""
    folder = tmp_path_factory.mktemp("first")
    return finished(folder, USE + HEAR), folder / "cache"


@pytest.fixture
def filled(first: tuple[list[str], Path], tmp_path: Path) -> None:
    """The cache is as the first process left it."""
    shutil.copytree(first[1], tmp_path / "cache")


def kept(folder: Path) -> list[Path]:
    return sorted(file for file in (folder / "cache").rglob("*") if file.is_file())


@pytest.mark.usefixtures("filled")
def test_the_next_process_compiles_nothing(first: tuple[list[str], Path], run: Run) -> None:
    assert first[0] == ["6.0", "-8.0", "4"]
    assert run(USE + HEAR) == ["6.0", "-8.0", "0"]


@pytest.mark.long
def test_what_never_runs_is_never_compiled(first: tuple[list[str], Path], run: Run, tmp_path: Path) -> None:
    run(USE.replace(", outer(x, False)", ""))
    assert not any("seldom" in file.name for file in kept(tmp_path))
    assert any("seldom" in file.name for file in kept(first[1].parent))


@pytest.mark.few(1)
@pytest.mark.parametrize("which", [slice(None), *(slice(k, k + 1) for k in range(4))], ids=str)
@pytest.mark.usefixtures("filled")
def test_files_of_the_cache_may_be_lost_or_cut_off(which: slice, run: Run, tmp_path: Path) -> None:
    files = kept(tmp_path)
    assert len(files) == 4
    for number, file in list(enumerate(files))[which]:
        if number % 2:
            file.unlink()
        else:
            os.truncate(file, file.stat().st_size // 2)
    assert run(USE) == ["6.0", "-8.0"]


PLANTED = """
import os, pickle, sys, zlib
from pathlib import Path
from rungwise.compilation import cache
class Planted:
    def __reduce__(self):
        return open, ("planted", "w")
for file in Path("cache").rglob("*.*"):
    if file.is_file():
        content = sys.argv[1].encode() if len(sys.argv) > 1 else pickle.dumps(Planted())
        file.write_bytes(cache._sealed(file, content) + zlib.compress(content))
"""


@pytest.mark.few(1)
@pytest.mark.parametrize("above", [0, 1])
@pytest.mark.usefixtures("filled")
def test_a_cache_to_which_others_may_write_is_not_read(
    above: int, start: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    """A file with a right digest that calls what it likes, as another user may have put it there."""
    start(PLANTED).communicate(timeout=120)
    (tmp_path / "home").mkdir()
    shutil.move(tmp_path / "cache", tmp_path / "home" / "cache")
    here = (
        f"import os\nos.environ['RUNGWISE_CACHE'] = 'home/cache'\nos.environ['TMPDIR'] = {str(tmp_path)!r}\n"
    )
    open_to_all = tmp_path / ("home" if above else "home/cache")
    open_to_all.chmod(0o777)
    out, err = start(here + USE).communicate(timeout=120)
    assert out.split() == ["6.0", "-8.0"] and not (tmp_path / "planted").exists()
    assert f"others may write to {open_to_all}" in err and "Traceback" not in err
    open_to_all.chmod(0o700)
    start(here + USE).communicate(timeout=120)
    assert (tmp_path / "planted").exists()  # so it would have been called


@pytest.mark.few(1)
@pytest.mark.parametrize("content", ["", "no pickle", "cos\nnothing\n(tR.", "I1\n."])
@pytest.mark.usefixtures("filled")
def test_files_with_a_right_digest_and_wrong_content_are_passed_over(
    content: str, start: Callable[[str], subprocess.Popen[str]], run: Run
) -> None:
    start(PLANTED.replace("len(sys.argv) > 1", "True").replace("sys.argv[1]", repr(content))).communicate()
    assert run(USE) == ["6.0", "-8.0"]


@pytest.mark.long
@pytest.mark.usefixtures("filled")
def test_folders_in_the_place_of_files_are_passed_over(run: Run, tmp_path: Path) -> None:
    for file in kept(tmp_path):
        file.unlink()
        file.mkdir()
    assert run(USE) == ["6.0", "-8.0"]


def test_folders_are_private_as_keys_of_ssh_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "above" / "cache"
    assert private.made(folder) == (folder, "") and folder.stat().st_mode & 0o777 == 0o700
    for mode, open_ in ((0o755, False), (0o757, True), (0o1777, True), (0o700, False)):
        folder.chmod(mode)
        assert bool(private.open_to_others(folder)) == open_, oct(mode)
    for mode, open_ in ((0o757, True), (0o1777, False), (0o755, False)):
        folder.parent.chmod(mode)
        assert bool(private.open_to_others(folder)) == open_, oct(mode)
    folder.chmod(0o770)
    monkeypatch.setattr(private, "_is_alone", lambda *_: True)
    assert private.open_to_others(folder) == ""
    monkeypatch.setattr(private, "_is_alone", lambda *_: False)
    assert private.open_to_others(folder).startswith(f"others may write to {folder} (remove it")
    folder.chmod(0o700)
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    assert private.open_to_others(folder) == f"{folder} belongs to another user"
    link = tmp_path / "link"
    link.symlink_to(folder)
    assert private.open_to_others(link) == f"{folder} belongs to another user"


def test_a_folder_is_the_one_that_was_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not a link that may lead elsewhere later, nor a path from where the process is now; and nothing is made
    where others may replace it."""
    (tmp_path / "own").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "own")
    assert private.made(tmp_path / "link" / "cache") == (tmp_path / "own" / "cache", "")
    monkeypatch.chdir(tmp_path)
    assert private.made(Path("here")) == (tmp_path / "here", "")
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    _, why = private.made(tmp_path / "open" / "cache")
    assert (
        why.startswith(f"others may write to {tmp_path / 'open'}") and not (tmp_path / "open/cache").exists()
    )
    (tmp_path / "one").symlink_to(tmp_path / "other")
    (tmp_path / "other").symlink_to(tmp_path / "one")
    assert private.made(tmp_path / "one" / "cache")[1]
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "open"))
    private.of_process.cache_clear()
    assert not private.of_process().is_relative_to(tmp_path / "open")
    private.of_process.cache_clear()


@pytest.mark.parametrize("which", ["folder", "file"])
@pytest.mark.usefixtures("filled")
def test_what_others_may_write_to_within_the_cache_is_not_read(
    which: str, start: Callable[[str], subprocess.Popen[str]], run: Run, tmp_path: Path
) -> None:
    start(PLANTED).communicate(timeout=120)
    for file in kept(tmp_path):
        (file.parent if which == "folder" else file).chmod(0o777)
    assert run(USE) == ["6.0", "-8.0"] and not (tmp_path / "planted").exists()


def test_a_file_in_the_place_of_a_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("")
    assert "cannot be written" in private.made(tmp_path / "cache" / "below")[1]


def test_two_processes_may_compile_at_once(start: Callable[[str], subprocess.Popen[str]]) -> None:
    both = [start(USE) for _ in range(2)]
    assert [process.communicate(timeout=120)[0].split() for process in both] == [["6.0", "-8.0"]] * 2


@pytest.mark.long
@pytest.mark.parametrize("files", [1, 0, 2])
def test_a_kill_in_the_middle_harms_nothing(
    files: int, start: Callable[[str], subprocess.Popen[str]], run: Run, tmp_path: Path
) -> None:
    process = start(USE)
    limit = time.monotonic() + 60.0
    while len(kept(tmp_path)) <= files and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.001)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert run(USE) == ["6.0", "-8.0"]


@pytest.mark.long
@pytest.mark.usefixtures("filled")
def test_an_edited_callee_is_compiled_again(run: Run, tmp_path: Path) -> None:
    (tmp_path / "callee.py").write_text(CALLEE.replace("FACTOR = 2.0", "FACTOR = 3.0"))
    assert run(USE) == ["9.0", "-27.0"]


@pytest.mark.long
def test_a_rare_path_is_first_needed_in_many_threads(run: Run) -> None:
    for _ in range(2):
        assert run(THREADS) == [str(-4.0 * (1.0 + k)) for k in range(8)]


@pytest.mark.long
def test_an_interrupt_while_compiling_is_an_interrupt_of_the_call(run: Run) -> None:
    assert run(STOPPED) == ["-4.0"]


@pytest.mark.long
def test_an_interrupt_before_linking_begins_is_one_of_the_call(
    start: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    (tmp_path / "waiting.py").write_text(WAITING)
    out, err = start(INTERRUPTED).communicate(timeout=120)
    assert out.split() == ["interrupted", "2.0", "interrupted", "-2.0"] * 2
    assert "Error" not in err and "Exception" not in err, err


@pytest.mark.long
def test_the_command_line_raises_an_interrupt_when_the_kernel_is_loaded(run: Run) -> None:
    loaded = [
        word
        for name, total in (("grow", "6.0"), ("seldom", "-4.0"))
        for word in (name, "loaded", "interrupted", total)
    ]
    assert run(PUT_OFF) == loaded


@pytest.mark.long
def test_a_wait_is_announced(start: Callable[[str], subprocess.Popen[str]]) -> None:
    hurry = "import rungwise.compilation.progress as p\np.compiling._next = p.SHORT_S = 1e-9\n"
    _, err = start(hurry + USE).communicate(timeout=120)
    assert err.startswith(
        "rungwise: compiling kernels, once (for about a minute, which counts towards no limit)"
    )


LIMITED = """
import pickle, threading, time
from rungwise.compilation.progress import compiling
from rungwise.deadline import Deadline
begun, rung = Deadline(0.1), []
halted = begun.running().__enter__().halt
compiling.begin()
time.sleep(0.4)
print(begun.is_over, halted[0], round(begun.seconds, 1))
sent = pickle.dumps(begun)
compiling.end()
print(begun.is_over, halted[0], pickle.loads(sent).is_over)
compiling._took = 100.0, None  # as in another process, which compiled longer
print(round(pickle.loads(sent).seconds, 1))
"""


def test_compilation_counts_towards_no_limit(run: Run) -> None:
    """The clock of limits stands still meanwhile, also that of a deadline that goes to another process."""
    assert run(LIMITED) == ["False", "0", "0.1", "False", "0", "False", "0.1"]


@pytest.fixture(scope="module")
def for_any_processor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    finished(folder, FOR_ANY_PROCESSOR + USE)
    return folder / "cache"


@pytest.fixture
def shipped(for_any_processor: Path, tmp_path: Path) -> Path:
    """Kernels as a wheel brings them; the user's own cache is empty."""
    return Path(shutil.copytree(for_any_processor, tmp_path / "shipped"))


@pytest.mark.long
@pytest.mark.usefixtures("shipped")
def test_kernels_of_a_wheel_are_not_compiled_again(run: Run, tmp_path: Path) -> None:
    assert run(AS_FROM_A_WHEEL + USE + HEAR) == ["6.0", "-8.0", "0"]
    assert not kept(tmp_path)


def _flip(file: Path) -> None:
    code = bytearray(file.read_bytes())
    code[len(code) // 2] ^= 1
    file.write_bytes(code)


def _swap(file: Path) -> None:
    """Takes the place of another kernel, as a whole file."""
    for other in file.parent.iterdir():
        other.write_bytes(file.read_bytes())


@pytest.mark.long
@pytest.mark.parametrize("harm", [_flip, _swap, Path.unlink, lambda file: os.truncate(file, 40)])
def test_a_damaged_or_foreign_kernel_of_a_wheel_is_passed_over(
    harm: Callable[[Path], None], run: Run, shipped: Path
) -> None:
    files = [file for file in sorted(shipped.rglob("*")) if file.is_file()]
    for file in files[:1] if harm is _swap else files:
        harm(file)
    *said, compiled = run(AS_FROM_A_WHEEL + USE + HEAR)
    assert said == ["6.0", "-8.0"] and int(compiled) == (len(files) - 1 if harm is _swap else len(files))


@pytest.mark.long
def test_kernels_hand_over_arrays_of_all_kinds(run: Run, tmp_path: Path) -> None:
    (tmp_path / "many.py").write_text(MANY)
    assert run(HANDED) == ["alike"] * 3


def test_indices_in_kernels_of_the_package_count_from_the_start_unless_they_are_literals() -> None:
    """numba compares every index with zero, so that -1 may mean the last element; kernels do without."""
    numba = import_module("numba")
    import_module("rungwise.compilation.calls")
    compared = []
    for module in ("rungwise.made", "elsewhere"):
        made: dict[str, Any] = {"__name__": module}
        exec("def read(x, i):\n    return x[i] + x[-1]\n", made)
        read = numba.njit(made["read"])
        assert read(np.array([1.0, 2.0, 4.0]), 1) == 6.0
        compared.append("icmp slt i64" in read.inspect_llvm(read.signatures[0]))
    assert compared == [False, True]
    assert read(np.array([1.0, 2.0, 4.0]), -2) == 6.0


def test_kernels_of_sets_are_compiled_for_a_wheel(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a wheel asks, to have all kernels of sets and designs, is answered."""
    monkeypatch.setattr(sys, "argv", ["compilation", "sets"])
    import_module("rungwise.compilation.__main__").main()
    assert "kernels compiled" in capsys.readouterr().out
