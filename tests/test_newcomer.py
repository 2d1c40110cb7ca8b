"""A newcomer in an empty folder installs the wheel, types what the pages say, and sees what they print."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from types import ModuleType

import pytest
import typer.main
import yaml

import rungwise as rw
import rungwise.gym
from rungwise.cli import app
from tests.pages import ROOT, Block, blocks, same

pytestmark = pytest.mark.pages

NOTEBOOKS = ROOT / "docs" / "notebooks"
MARK = "-- next block --"


SOLVE = """
import rungwise as rw
print(rw.solve(rw.Problem.lcp([[2.0, 1.0], [1.0, 2.0]], [-1.0, -1.0])).status.value)
from rungwise.compilation.progress import compiling
print(compiling.kernels, rw.__file__)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    wheel, programs = _installed(tmp_path_factory.mktemp("newcomer"))
    assert wheel == f"rungwise-{rw.__version__}-py3-none-any.whl"
    return programs


def _installed(folder: Path, **named: str) -> tuple[str, Path]:
    """Name of a wheel, built from a copy of what is kept, and folder of the programs of an environment with
    nothing of rungwise but this wheel. What rungwise needs comes from the environment of the tests: no
    network is asked."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, env=os.environ | named)
    (wheel,) = folder.glob("rungwise-*.whl")
    venv.create(folder / "env", with_pip=False, symlinks=True)
    programs = folder / "env" / "bin"
    (site,) = (folder / "env").glob("lib/python*/site-packages")
    pip = [sys.executable, "-m", "pip", "--python", str(programs / "python"), "install"]
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], check=True, capture_output=True)
    needed = {Path(path) for path in sys.path if path.endswith("site-packages")}
    (site / "needed.pth").write_text("".join(f"{path}\n" for path in needed))
    return wheel.name, programs


@pytest.mark.long
def test_a_wheel_with_kernels_compiles_nothing(tmp_path: Path) -> None:
    """It brings the kernels of one question; a fresh environment with an empty cache has its answer."""
    apart = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    any_processor = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    build = os.environ | any_processor | {"RUNGWISE_CACHE": str(tmp_path / "kernels")}
    subprocess.run([sys.executable, "-c", SOLVE], check=True, capture_output=True, env=build)
    wheel, programs = _installed(tmp_path, RUNGWISE_KERNELS=str(tmp_path / "kernels"))
    assert not wheel.endswith("-any.whl")
    fresh = apart | {"RUNGWISE_CACHE": str(tmp_path / "cache")}
    said = subprocess.run(
        [programs / "python", "-c", SOLVE], capture_output=True, text=True, env=fresh, cwd=tmp_path
    )
    status, compiled, where = said.stdout.split()
    assert (status, compiled) == ("solved", "0") and where.startswith(str(programs.parent)), said.stderr
    assert not any(file.is_file() for file in (tmp_path / "cache").rglob("*"))


@pytest.mark.parametrize("page", ["README.md", "docs/tutorial.md"])
def test_pages_print_what_they_say(page: str, installed: Path, tmp_path: Path) -> None:
    """Files are written, commands typed, and Python run in one session, in the order of the page."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"PATH": f"{installed}{os.pathsep}{os.environ['PATH']}", "NO_COLOR": "1"}
    python: list[Block] = []
    for block in blocks(ROOT / page):
        if block.file:
            (tmp_path / block.file).write_text(block.code, "utf-8")
        elif block.language == "python":
            python.append(block)
        elif block.language == "sh":
            said = subprocess.run(
                ["sh", "-e"], input=block.code, cwd=tmp_path, env=environment, capture_output=True, text=True
            )
            assert said.returncode == 0, said.stderr
            assert block.printed is None or same(said.stdout, block.printed), said.stdout
    session = f"\nprint({MARK!r})\n".join(block.code for block in python)
    where = "\nimport sys; print(rw.__file__, file=sys.stderr)"
    said = subprocess.run(
        [installed / "python", "-"],
        input=session + where,
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert said.returncode == 0, said.stderr
    assert said.stderr.splitlines()[-1].startswith(str(installed.parent)), "another rungwise was run"
    for block, printed in zip(python, said.stdout.split(MARK), strict=True):
        assert same(printed, block.printed or ""), f"{block.code}\nprints\n{printed}"


def _recorder() -> ModuleType:
    spec = importlib.util.spec_from_file_location("record", NOTEBOOKS / "record.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", sorted(file.stem for file in NOTEBOOKS.glob("*.ipynb")))
def test_notebooks_print_what_they_keep(name: str) -> None:
    record = _recorder()
    pictures = 0
    for cell, said, picture in record.printed(record.read(NOTEBOOKS / f"{name}.ipynb")):
        assert same(said, record.kept(cell)), f"{''.join(cell['source'])}\nprints\n{said}"
        assert record.pictured(cell) == (picture is not None)
        pictures += record.pictured(cell)
    assert pictures


def test_commands_of_the_gallery_are_its_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each page names the runs that its picture shows, and each shipped scene has a page."""
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    gallery = importlib.import_module("gallery")
    assert set(gallery.GALLERY) == set(rw.shipped())
    for scene, panels in gallery.GALLERY.items():
        (block,) = (b for b in blocks(ROOT / "docs" / "gallery" / f"{scene}.md") if b.language == "sh")
        shown = [(panel.scene, panel.model, panel.parameters, "inputs" in panel.options) for panel in panels]
        assert [_simulated(line) for line in block.code.splitlines()] == shown
        assert (ROOT / "docs" / "gallery" / f"{scene}.gif").stat().st_size > 10_000


def _simulated(line: str) -> tuple[str, str, dict[str, float], bool]:
    words = shlex.split(line)
    assert words[:2] == ["rungwise", "sim"] and words[3] == "--model"
    values = [words[k + 1].split("=") for k, word in enumerate(words) if word == "--set"]
    return words[2], words[4], {name: float(value) for name, value in values}, "--inputs" in words


@pytest.mark.parametrize("scene", rw.shipped())
def test_pages_of_the_gallery_print_what_they_say(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    kept = ROOT / "docs" / "gallery" / f"{scene}.yaml"
    if kept.is_file():
        shutil.copy(kept, tmp_path)
    for block in blocks(ROOT / "docs" / "gallery" / f"{scene}.md"):
        if block.file:
            Path(block.file).write_text(block.code, "utf-8")
        else:
            for line in block.code.splitlines():
                app(shlex.split(line)[1:], standalone_mode=False)
            said = capsys.readouterr().out
            assert block.printed is not None and same(said, block.printed), said


COMMAND = re.compile(r"(?:^ {4}|^|`)((?:rungwise|python|make) [^`\n]*)", re.MULTILINE)
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", [*PAGES, *sorted(NOTEBOOKS.glob("*.ipynb"))], ids=lambda page: page.stem)
def test_commands_of_the_pages_are_commands(page: Path) -> None:
    """Commands and options of rungwise exist, and so do programs and targets; those that take long are not
    run here."""
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    for line in COMMAND.findall(page.read_text("utf-8")):
        command = re.sub(
            r"[][]|\bN\b", lambda m: "1" if m[0] == "N" else "", re.split(r"\s{3,}|\s#\s", line)[0]
        )
        program, *words = shlex.split(command)
        if program == "python" and words[0].endswith(".py"):
            assert (ROOT / words[0]).is_file(), line
            said = (ROOT / words[0]).read_text("utf-8")
            if "from arguments import" in said or "import arguments" in said:  # options that benchmarks share
                said += (ROOT / "benchmarks" / "arguments.py").read_text("utf-8")
            assert all(f'"{word}"' in said for word in words[1:] if word.startswith("--")), line
        elif program == "make" and len(words) == 1:
            assert words[0] in targets, line
        elif program == "rungwise" and words and words[0] in COMMANDS:
            parse(words)


COMMANDS = set(typer.main.get_command(app).commands)


def parse(words: list[str]) -> None:
    """Read a command's arguments, as far as it does so before it begins. Raises an error of use."""
    command = typer.main.get_command(app).commands[words[0]]
    if words[1:]:
        command.make_context(words[0], words[1:])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_of_the_pages_lead_to_files(page: Path) -> None:
    """As a code host shows them; those of the site are checked when it is built."""
    for target in re.findall(r"\]\(([^)#\s]*)(?:#[^)\s]*)?\)", page.read_text("utf-8")):
        if target and not target.startswith(("http:", "https:")):
            assert (page.parent / target).exists(), target


def test_every_page_and_every_public_name_is_on_the_site() -> None:
    docs = ROOT / "docs"
    trees = "\n".join(
        tree
        for page in PAGES
        for tree in re.findall(r"```{toctree}(.*?)```", page.read_text("utf-8"), re.DOTALL)
    )
    listed = set(re.findall(r"^(?:.*<)?([\w/-]+)>?$", trees, re.MULTILINE))
    pages = {file.relative_to(docs).with_suffix("").as_posix() for file in docs.rglob("*.md")}
    pages |= {f"notebooks/{file.stem}" for file in NOTEBOOKS.glob("*.ipynb")}
    assert pages - {"index"} <= listed
    api = (docs / "api.md").read_text("utf-8")
    assert set(re.findall(r"\b(?:rungwise|rw)\.(?!gym\b)(\w+)", api)) == set(rw.__all__)
    assert set(re.findall(r"\brungwise\.gym\.(\w+)", api)) == set(rungwise.gym.__all__)


def test_pictures_are_drawn_from_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    gallery = importlib.import_module("gallery")
    assert gallery.main(["--only", "disagree", "two_finger", "--out", str(tmp_path)], frames=2) == 0
    assert (tmp_path / "disagree.gif").stat().st_size > 10_000
    for column in gallery.DISAGREE:
        fine, broken = column
        assert not fine.bad and broken.bad


def test_what_the_picture_says_is_so() -> None:
    """A gripper lifts on four rungs and not on the kinematic one; a push coasts; a grasp is lost."""
    lifted = [rw.simulate("gripper", model).outcome.name for model in rw.LADDER[1:]]
    assert lifted == ["timeout", "goal", "goal", "goal", "goal"]
    fast = {"v": 0.5, "near": 0.0}
    inputs = [rw.Segment({"ux": 1.0}, 0.2), rw.Segment({"ux": 0.0}, 0.4)]
    stopped, coasted = (
        rw.simulate("push", model, parameters=fast, inputs=inputs).final["box"]["x"]
        for model in ("quasistatic-rigid", "dynamic-rigid")
    )
    assert coasted - stopped > 0.02
    hard = {"v2": 0.55, "restitution": 1.0}
    ends = [
        rw.simulate("two_finger", model, parameters=hard).outcome.name
        for model in ("quasistatic-rigid", "dynamic-rigid")
    ]
    assert ends == ["goal", "doomed"]


def test_the_version_comes_from_one_place() -> None:
    assert tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dynamic"] == ["version"]
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))["version"] == rw.__version__
    assert f"Version {rw.__version__}" in (ROOT / "docs" / "stability.md").read_text("utf-8")
    assert re.search(r"^## \[\d+\.\d+\.\d+\] - ", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
