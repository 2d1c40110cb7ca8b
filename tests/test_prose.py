"""What prose names exists: modules, functions, members and files that docstrings, comments and pages name."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "rungwise"
FOLDERS = ("src", "benchmarks", "examples", "docs")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAME, DOTTED = r"[A-Za-z_]\w*", r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+"
FILE = r"[\w-]+(?:/[\w-]+)*\.(?:py|pyi|md|txt)"
QUOTED = re.compile(r'(^ *)?r?"""(.*?)"""|(?:^|  )# ([^\n]*)', re.DOTALL | re.MULTILINE)


def prose(file: Path) -> str:
    """Text of a page without its code, or docstrings and comments of a module."""
    text = file.read_text("utf-8")
    if file.suffix == ".md":
        return re.sub(r"```.*?```|\(https?:[^)]*\)", "", text, flags=re.DOTALL)
    return "\n".join(q[2] or q[3] or "" for q in QUOTED.finditer(text) if q[1] is not None or q[3])


def code(file: Path) -> str:
    return QUOTED.sub(lambda q: q[0] if q[1] is None and q[2] else "", file.read_text("utf-8"))


def words(text: str) -> set[str]:
    return set(re.findall(r"\w+", text))


@cache
def known() -> set[str]:
    """Words of the code without its docstrings and comments, of scenes and scripts of pages, and of lists."""
    kinds = (".pyi", ".yaml", ".xml", ".js", ".html", ".css")
    others = [f for f in PACKAGE.rglob("*") if f.suffix in kinds]
    found = set().union(*(words(f.read_text("utf-8")) for f in (*others, ROOT / "pyproject.toml")))
    for file in (f for folder in (*FOLDERS, "tests") for f in (ROOT / folder).rglob("*.py")):
        found |= words(code(file)) | {file.stem}
    return found


@cache
def blocks() -> dict[str, list[str]]:
    """The statements of modules of the package, by the dotted names of the modules."""
    found: dict[str, list[str]] = {}
    for file in [*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")]:
        parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
        module = ".".join(p for p in parts if p != "__init__")
        found.setdefault(module, []).extend(re.split(r"\n(?=\w)", code(file)))
    return found


def held(block: str) -> set[str]:
    """Names that a statement of a module gives it."""
    defined = re.match(r"(?:def|class) (\w+)|([\w, ]+)(?::[^=]*)? = ", block)
    return words(defined[1] or defined[2]) if defined else words(block) if "import" in block else set()


@cache
def modules() -> dict[str, set[str]]:
    """What each module of the package holds."""
    return {module: set().union(*map(held, found)) for module, found in blocks().items()}


@cache
def rooms() -> set[str]:
    return {part for module in modules() for part in module.split(".")}


@cache
def members() -> dict[str, set[str]]:
    """Words of classes and of tables of modules, such as record types, by their names in small letters."""
    found: dict[str, set[str]] = {}
    for block in (block for statements in blocks().values() for block in statements):
        if name := re.match(r"(?:class )?(\w+)(?:\(|:| =)", block):
            found.setdefault(name[1].lower(), set()).update(words(block))
    return found


@cache
def is_in_a_module(*parts: str) -> bool:
    """Whether the parts end the name of a module, or are a module and what it holds."""
    for length in range(1, len(parts) + 1):
        begun, rest = ".".join(parts[:length]), parts[length:]
        for module, names in modules().items():
            is_here = f".{module}".endswith(f".{begun}") and (not rest or rest[0] in names)
            if is_here and (len(rest) < 2 or rest[1] in members().get(rest[0].lower(), set())):
                return True
    return False


@cache
def files() -> list[str]:
    found = [*ROOT.glob("*"), *(f for folder in (*FOLDERS, "tests") for f in (ROOT / folder).rglob("*"))]
    return [f"/{file.relative_to(ROOT)}" for file in found]


def exists(name: str, where: Path) -> bool:
    """Whether the package has what is named; names that begin with no room of it need only be known in it."""
    if re.fullmatch(FILE, name):
        return any(file.endswith(f"/{name}") for file in files())
    is_page = where.suffix == ".md"
    if not re.fullmatch(DOTTED, name):
        return is_page or not re.fullmatch(NAME, name) or name in known()
    parts = re.sub(r"^rw\.", "rungwise.", name).split(".")
    if is_in_a_module(*parts) or parts[-1] in members().get(parts[-2].lower(), set()):
        return True
    return parts[-1] in known() if is_page else parts[0] not in rooms() and known().issuperset(parts[1:])


def named(file: Path) -> set[str]:
    text = prose(file)
    ticked = {re.sub(r"\(.*\)$", "", n) for n in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text)}
    return {n for n in ticked | set(re.findall(rf"(?<![\w./-]){FILE}\b", text)) if "NAME" not in n}


@pytest.mark.long
@pytest.mark.parametrize("folder", [*FOLDERS, "pages"])
def test_what_prose_names_exists(folder: str) -> None:
    read = PAGES if folder == "pages" else sorted((ROOT / folder).rglob("*.py"))
    missing = [f"{file.relative_to(ROOT)}: {n}" for file in read for n in named(file) if not exists(n, file)]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize(
    "name", ["planar.strays", "simulation.core.no", "middle.py", "no_such_" + "parameter"]
)
def test_what_is_gone_is_found(name: str) -> None:
    assert not exists(name, PACKAGE / "kernel.py")
