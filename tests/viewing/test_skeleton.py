"""The skeleton of pages: each kind has its controls once, its keys, and every name of its scripts once."""

from __future__ import annotations

import re
import sys
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.plane.clip import clip
from rungwise.viewing.plane.run_page import KIND as PLANE
from rungwise.viewing.plane.run_page import page as plane_page
from rungwise.viewing.sets.sets_page import KIND as SETS
from rungwise.viewing.sets.sets_page import page as sets_page
from rungwise.viewing.skeleton import PAGE, Kind, fill, kept
from rungwise.viewing.space.run_page import KIND as SPACE
from rungwise.viewing.space.run_page import page as space_page

sys.path.insert(0, str(Path(__file__).parent))
from space_films import ball_and_box

KINDS = {"plane": PLANE, "space": SPACE, "sets": SETS}
CONTROLS = (
    "title", "clock", "theme", "views", "beside", "single", "stage", "play", "back", "ahead", "time", "speed",
    "loop", "models", "reasons", "legend", "data",
)  # fmt: skip
NAMED = {"space": " ", "home": "Home", "end": "End", "\u2190": "ArrowLeft", "\u2192": "ArrowRight"}
DECLARED = re.compile(r"^(?:function|class|const|let) (\w+)", re.MULTILINE)


class Page(HTMLParser):
    """Identities of elements, the keys that are named, and what the scripts and styles say."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.identities: list[str] = []
        self.keys: list[str] = []
        self.open: list[str] = []
        self.script = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.identities += [value for name, value in attrs if name == "id" and value]

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self.open[-1:] == ["kbd"]:
            self.keys.append(data)
        if self.open[-1:] == ["script"]:
            self.script += data

    def bound(self, table: str) -> set[str]:
        """Keys of a table in the scripts."""
        found = re.search(rf"^const {table} = \{{(.*?)\}};$", self.script, re.MULTILINE | re.DOTALL)
        assert found is not None
        return {quoted or plain for quoted, plain in re.findall(r'(?:"(.{1,2})"|\b(\w+)): ?[(\w]', found[1])}


@pytest.fixture(scope="module")
def pages() -> dict[str, Page]:
    box = {"v1": (0.5, 1.5), "v2": (0.5, 1.5)}
    found = rw.feasible_set("two_finger", rw.KINEMATIC, tuple(box), box=box, tol=0.2, threads=1)
    texts = {
        "plane": plane_page([clip(rw.simulate("two_finger", rw.KINEMATIC, frames=5))]),
        "space": space_page([ball_and_box(1.0, "dynamic-rigid", duration=0.1)]),
        "sets": sets_page([found]),
    }
    return {name: Page(text) for name, text in texts.items()}


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", KINDS)
def test_every_control_is_there_once(pages: dict[str, Page], kind: str) -> None:
    count = Counter(pages[kind].identities)
    assert [name for name in CONTROLS if count[name] != 1] == []
    assert [name for name in count if count[name] > 1] == []


@pytest.mark.parametrize("kind", KINDS)
def test_scripts_find_the_elements_that_they_name(pages: dict[str, Page], kind: str) -> None:
    page = pages[kind]
    made = set(re.findall(r'\bid: "([\w-]+)"', page.script))
    named = set(re.findall(r'\$\("([\w-]+)"\)', page.script))
    made_by_charts = set(re.findall(r'new Chart\("(\w+)"', page.script))
    assert named | made_by_charts <= made | set(page.identities)


@pytest.mark.parametrize("kind", KINDS)
def test_every_name_is_declared_once(pages: dict[str, Page], kind: str) -> None:
    """The scripts of a page share one scope, in which a second function of a name replaces the first."""
    names = DECLARED.findall(pages[kind].script)
    assert len(names) > 60
    assert [name for name, count in Counter(names).items() if count > 1] == []


def test_keys_of_the_player_are_the_same_on_all_pages(pages: dict[str, Page]) -> None:
    maps = {kind: (page.bound("PLAYING"), page.bound("SHARED_KEYS")) for kind, page in pages.items()}
    assert maps["plane"] == maps["space"] == maps["sets"]
    assert maps["plane"] == ({" ", "Home", "End", "+", "=", "-", "l"}, {"t", "m", "b"})


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_names_its_keys_and_takes_none_of_the_player(pages: dict[str, Page], kind: str) -> None:
    page = pages[kind]
    shared = page.bound("PLAYING") | page.bound("SHARED_KEYS")
    shown = re.findall(r'id="show".*?</fieldset>', fill(KINDS[kind], "", {}), re.DOTALL)
    toggles = {key.lower() for key in re.findall(r"<kbd>(\w)</kbd>", "".join(shown))}
    own = page.bound("KEYS") | toggles
    assert own & shared == set() and (kind == "sets") == (own == set())
    named = {NAMED.get(key, key.lower()) for key in page.keys} - {"shift", "1", "9"}
    assert named == (shared | own | {"ArrowLeft", "ArrowRight"}) - {"="}


@pytest.mark.parametrize("kind", KINDS)
def test_scripts_that_pages_share_are_there_once(pages: dict[str, Page], kind: str) -> None:
    for name in ("base.js", "panels.js", "legend.js", "clock.js", "player.js"):
        assert pages[kind].script.count((PAGE / name).read_text("utf-8")) == 1


def test_parts_fill_slots_of_parts_and_data_is_left_as_it_is(tmp_path: Path) -> None:
    file, script = tmp_path / "parts.html", tmp_path / "own.js"
    file.write_text("<!-- models -->\n<b>{{inner}}</b>{{none}}\n<!-- inner -->\n<i>\n  one</i>\n", "utf-8")
    script.write_text("const SLOT = '{{title}}';\n", "utf-8")
    text = fill(Kind("odd", (file,), script, (), ()), "<{{data}}>", {"key": "{{models}}"})
    assert "<b><i>\n  one</i></b>\n" in text and '<main class="odd">' in text
    assert "&lt;{{data}}&gt;" in text and '{"key":"{{models}}"}' in text and "'{{title}}'" in text


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_the_last_frame_is_kept(count: int) -> None:
    for every in (1, 2, 3, 50):
        frames = kept(count, every)
        assert frames[0] == 0 and frames[-1] == count - 1 and (np.diff(frames) <= every).all()
