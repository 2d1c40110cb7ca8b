"""The page of sets in a real browser, where there is one."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.sets import sets_page as sets

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import browser as driver

PROGRAM = driver.find()
in_browser = pytest.mark.skipif(
    PROGRAM is None, reason=f"needs a browser: none of {', '.join(driver.NAMES)} is on the PATH"
)
BOX = {"v1": (0.2, 2.2), "v2": (0.2, 2.2), "mu": (0.0, 0.9)}
PIXELS = "[...raster.owner.keys()]"
PLACE = "i => [i % raster.width + 0.5, Math.floor(i / raster.width) + 0.5].map(x => x / raster.seen.dense)"
LIFTS = (rw.KINEMATIC, rw.DYNAMIC_RIGID)
SETTLED = "new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"


@pytest.fixture(scope="module")
def found() -> list[rw.FeasibleSet]:
    return [
        rw.feasible_set("two_finger", model, tuple(BOX), box=BOX, tol=0.03, threads=1)
        for model in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT)
    ]


@pytest.fixture(scope="module")
def flat() -> rw.FeasibleSet:
    return rw.feasible_set(
        "two_finger", rw.DYNAMIC_RIGID, ("v1", "v2"), box=BOX, parameters={"restitution": 1.0}, threads=1
    )


@pytest.fixture(scope="module")
def file(found: list[rw.FeasibleSet], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rw.view(found, html=tmp_path_factory.mktemp("sets") / "sets.html")[0]


@pytest.fixture(scope="module")
def page(file: Path) -> Iterator[Any]:
    assert PROGRAM is not None
    with driver.Browser(PROGRAM, size=(1360, 1000)) as opened:
        opened.open(file)
        yield opened


def choose(page: Any, *values: float) -> None:
    page.evaluate(f"choose({list(values)}.map((x, a) => partOf(a, x))), play(false), {SETTLED}")


def rectangle(page: Any, name: str) -> dict[str, float]:
    found: dict[str, float] = page.evaluate(f"$({name!r}).getBoundingClientRect().toJSON()")
    return found


@in_browser
def test_asks_for_nothing_and_plays(page: Any, file: Path) -> None:
    before = page.evaluate("[state.t, state.frames]")
    moved = page.evaluate("new Promise(r => setTimeout(() => r([state.t, state.frames]), 500))")
    assert moved[0] != before[0] and moved[1] > before[1] + 1
    assert [url for url in page.requests if not url.startswith("data:")] == [file.resolve().as_uri()]
    assert page.errors == []
    assert file.stat().st_size < 1_500_000


@in_browser
def test_labels_are_those_of_the_sets(page: Any, found: list[rw.FeasibleSet]) -> None:
    cells = page.evaluate("N")
    index = np.random.default_rng(4).integers(0, cells, (500, 3))
    parts = (index + 0.5) / cells
    shown = np.array(page.evaluate(f"{parts.tolist()}.map(p => SETS.map(s => labelAt(s, p)))"))
    low, high = found[0].box.T
    expected = [each.labels(low + parts * (high - low)) for each in found]
    assert np.array_equal(shown, np.stack(expected, axis=1)) and len(np.unique(shown)) == 2


@in_browser
def test_stored_runs_say_how_they_ended(page: Any) -> None:
    ends = page.evaluate("DATA.runs.map((row, i) => runsOf(i).map(c => c.outcome))")
    labels = page.evaluate("DATA.runs.map(row => row.labels.map(k => DATA.labels[k]))")
    names = {"goal": "feasible", "doomed": "doomed", "missed": "infeasible", "timeout": "infeasible"}
    assert [[names[end] for end in row] for row in ends] == labels and len(labels) == 48


@in_browser
def test_parts_of_the_box_are_written(page: Any, found: list[rw.FeasibleSet]) -> None:
    text = page.evaluate("$('models').textContent")
    for each in found:
        assert f"{100 * each.volumes()['feasible']:.2f} %" in text


@in_browser
def test_a_click_in_the_slice_shows_the_nearest_run(page: Any, found: list[rw.FeasibleSet]) -> None:
    """The point that was clicked, its labels, and the nearest stored run among those that end alike."""
    for v1, v2, mu in ((1.0, 0.9, 0.3), (1.9, 0.5, 0.3), (0.5, 0.27, 0.85)):
        choose(page, 1.0, 1.0, mu)
        place = page.evaluate(f"placeOf(boxOfSlice(), [partOf(0, {v1}), partOf(1, {v2})])")
        corner = rectangle(page, "slice")
        page.click(corner["x"] + place[0], corner["y"] + place[1])
        point = np.array(page.evaluate("values(chosen.point)"))
        assert point == pytest.approx([v1, v2, mu], abs=0.01)
        labels = [str(each.classify(point[None])[0]) for each in found]
        assert page.evaluate("SETS.map((_, k) => $(`here-${k}`).textContent)") == labels
        rows = page.evaluate("DATA.runs")
        alike = [r for r in rows if r["labels"] == [int(rw.Label[x.upper()]) for x in labels]]
        at = (point - found[0].box[:, 0]) / np.ptp(found[0].box, axis=1)
        nearest = min(alike, key=lambda row: np.linalg.norm(np.array(row["at"]) - at))
        assert rows[page.evaluate("chosen.run")] == nearest
        ends = page.evaluate("runsOf(chosen.run).map(c => c.outcome)")
        assert ends == [{"feasible": "goal"}.get(label, label) for label in labels]


@in_browser
def test_the_command_repeats_the_run(page: Any, tmp_path: Path) -> None:
    choose(page, 1.0, 0.9, 0.3)
    page.evaluate("$('front-1').click()")
    first, second = page.evaluate("$('command').textContent").splitlines()
    assert second == "rungwise view run --html run.html"
    arguments = shlex.split(first)
    assert arguments[:4] == ["rungwise", "sim", "two_finger", "--model"]
    done = subprocess.run(
        [sys.executable, "-m", *arguments, "--json"], capture_output=True, text=True, cwd=tmp_path
    )
    ran = json.loads(done.stdout)
    assert (ran["model"], ran["outcome"]) == ("dynamic-compliant", "goal")
    assert {name: ran["parameters"][name] for name in BOX} == {"v1": 1.0, "v2": 0.9, "mu": 0.3}
    page.evaluate("$('front-0').click()")


@in_browser
def test_boundaries_that_coincide_are_striped(page: Any) -> None:
    """Both models catch from r = 1/2 to 2 without friction: each colour is on the line and the surface."""
    choose(page, 1.0, 1.0, 0.05)
    seen = page.evaluate(
        """(() => {
          const c = $("slice"), g = c.getContext("2d"), k = c.width / c.clientWidth, b = boxOfSlice();
          const paints = SETS.map(set => rgb(set.colour()).join()), found = SETS.map(() => 0);
          for (let v = 0.6; v < 2.0; v += 0.005) for (let d = -0.03; d <= 0.03; d += 0.01) {
            const [x, y] = placeOf(b, [partOf(0, v), partOf(1, v / 2 + d), 0]);
            const at = paints.indexOf([...g.getImageData(k * x, k * y, 1, 1).data].slice(0, 3).join());
            if (at >= 0) found[at]++;
          }
          drawSpace(true);
          return [found, SETS.map((_, k) => raster.owner.filter(o => o === FIRST + k).length)]; })()"""
    )
    for counts in seen:
        assert min(counts) > 0.3 * max(counts) > 20


@in_browser
def test_the_legend_says_what_every_mark_is(page: Any) -> None:
    said = page.evaluate("$('slice-legend').textContent + $('legend').textContent")
    names = page.evaluate("SETS.map(set => set.name)")
    for word in (*names, "feasible", "doomed", "striped", "hatched", "chosen point", "stored runs", "slips"):
        assert word in said
    assert page.evaluate("$('reasons').childElementCount") == len(
        page.evaluate("[...new Set(runsOf(chosen.run).map(c => c.outcome + c.reason))]")
    )


@in_browser
def test_the_slider_moves_the_slice(page: Any) -> None:
    """Over v1 and mu, with v2 on the slider: the part is caught for v1 from v2 / 2 to 2 v2."""
    page.evaluate("$('up').value = 2, $('up').dispatchEvent(new Event('change'))")
    for v2, colours in ((0.5, [0, 0, 2]), (0.9, [2, 0, 0]), (2.0, [2, 2, 0])):
        part = (v2 - 0.2) / 2.0
        page.evaluate(
            f"$('value-1').value = {part}, $('value-1').dispatchEvent(new Event('input')), {SETTLED}"
        )
        assert f"v2 = {v2:g}" in page.evaluate("$('slice-title').textContent")
        seen, paints = page.evaluate(
            """(() => {
              const c = $("slice"), g = c.getContext("2d"), k = c.width / c.clientWidth;
              const at = v1 => { const [x, y] = placeOf(boxOfSlice(), [partOf(0, v1), 0, 0.82]);
                return [...g.getImageData(x * k, y * k, 1, 1).data].slice(0, 3); };
              return [[0.4, 0.85, 1.3].map(at), DATA.labels.map((_, k) => rgb(labelColour(k)))]; })()"""
        )
        assert [paints.index(colour) for colour in seen] == colours
    page.evaluate(f"$('up').value = 1, $('up').dispatchEvent(new Event('change')), {SETTLED}")


@in_browser
def test_a_click_on_the_surface_finds_the_boundary(page: Any) -> None:
    """It is the plane r = 1/2 or r = 2; with the cut off both are reached by turning."""
    page.evaluate("$('cut').checked = false, SETS[1].visible = false, turn(0, 0)")
    ratios = []
    for yaw in (-1.2, 2.2):
        choose(page, 1.0, 1.0, 0.1)
        page.evaluate(f"eye.yaw = {yaw}, drawSpace(false)")
        spots = page.evaluate(f"{PIXELS}.filter(i => raster.owner[i] === FIRST).map({PLACE})")
        corner = rectangle(page, "space")
        for x, y in spots[len(spots) // 4 :: len(spots) // 4][:3]:
            page.click(corner["x"] + x, corner["y"] + y)
            v1, v2, _ = page.evaluate("values(chosen.point)")
            ratios.append(min(v1 / v2, v2 / v1))
            page.evaluate("drawSpace(false)")
    assert len(ratios) == 6 and ratios == pytest.approx([0.5] * 6, abs=0.04)
    page.evaluate("$('cut').checked = true, SETS[1].visible = true, redraw(true)")


@in_browser
def test_the_cut_shows_the_slice_and_dragging_turns(page: Any) -> None:
    choose(page, 1.0, 1.0, 0.45)
    corner = rectangle(page, "space")
    page.evaluate("eye.yaw = -0.6, eye.pitch = 0.6, drawSpace(false)")
    above = page.evaluate(
        f"{PIXELS}.filter(i => raster.owner[i] !== NOTHING).map({PLACE}).map(p => pick(...p).part[2])"
    )
    assert max(above) < 0.51 and sum(abs(z - 0.5) < 1e-3 for z in above) > 1000
    middle = corner["x"] + corner["width"] / 2, corner["y"] + corner["height"] / 2
    before = page.evaluate("[eye.yaw, [...chosen.point]]")
    page.click(*middle, to=(middle[0] + 60, middle[1] + 20))
    after = page.evaluate("[eye.yaw, [...chosen.point]]")
    assert after[0] != before[0] and after[1] == before[1]
    page.evaluate("$('space').focus()")
    page.key("ArrowRight")
    assert page.evaluate("eye.yaw") == pytest.approx(after[0] + 0.1)


@in_browser
def test_the_other_parameters_can_be_shown(page: Any) -> None:
    choose(page, 1.0, 0.9, 0.3)
    page.evaluate(f"$('up').value = 2, $('up').dispatchEvent(new Event('change')), {SETTLED}")
    assert page.evaluate("[chosen.across, chosen.up, others()]") == [0, 2, [1]]
    page.evaluate("$('slice').focus()")
    page.key("ArrowUp")
    assert page.evaluate("values(chosen.point)") == pytest.approx([1.0, 0.9, 0.3 + 0.9 / 100])
    page.evaluate(f"$('up').value = 1, $('up').dispatchEvent(new Event('change')), {SETTLED}")
    unnamed = page.evaluate(
        "[...document.querySelectorAll('button, input, select')].filter(e => !(e.textContent.trim() ||"
        " e.ariaLabel || (e.labels && e.labels.length))).length"
    )
    assert unnamed == 0


@in_browser
def test_two_parameters_are_a_map(flat: rw.FeasibleSet, tmp_path: Path) -> None:
    assert PROGRAM is not None
    with driver.Browser(PROGRAM) as page:
        page.open(rw.view(flat, html=tmp_path / "map.html")[0])
        assert page.evaluate("$('space-part').hidden && others().length === 0")
        corner = rectangle(page, "slice")
        for v1, v2, label in ((1.0, 1.2, "feasible"), (2.0, 0.6, "doomed")):
            place = page.evaluate(f"placeOf(boxOfSlice(), [partOf(0, {v1}), partOf(1, {v2})])")
            page.click(corner["x"] + place[0], corner["y"] + place[1])
            assert page.evaluate("$('here-0').textContent") == label
        assert "--set restitution=1.0 --set v1=" in page.evaluate("$('command').textContent")
        assert page.errors == []


@pytest.mark.long
def test_stored_runs_cover_every_way_to_end(found: list[rw.FeasibleSet]) -> None:
    points = sets.run_points(found, 30)
    labels = np.stack([each.labels(points) for each in found], axis=1)
    kinds, counts = np.unique(labels, axis=0, return_counts=True)
    assert kinds.tolist() == [[0, 0], [0, 2], [2, 2]] and counts.min() == 10
    low, high = found[0].box.T
    parts = (points - low) / (high - low)
    apart = np.linalg.norm(parts[:, None] - parts, axis=-1) + 9.0 * np.eye(30)
    assert apart.min() > 0.05


@pytest.mark.long
def test_opens_on_a_model_with_something_to_show_and_frames_the_object(tmp_path: Path) -> None:
    """The kinematic rung leaves the part where it stands, whatever the jaws do; where they slide off it on
    the dynamic rung, their own force flings them metres away from a part of six centimetres."""
    box = {"squeeze": (0.0, 20.0), "mu": (0.0, 1.0)}
    found = [rw.feasible_set("gripper", model, tuple(box), box=box, tol=0.2) for model in LIFTS]
    data = data_of(rw.view(found, html=tmp_path / "sets.html")[0])
    assert data["opening"] == {"front": 1, "at": [0.5, 0.5]}
    x0, y0, x1, y1 = data["bounds"]
    assert 0.06 < x1 - x0 < 0.3 and 0.06 < y1 - y0 < 0.3


@pytest.mark.long
def test_opens_on_a_run_that_reaches_the_goal_where_the_middle_does_not(tmp_path: Path) -> None:
    """Jaws that press with 0 to 20 N hold the part of 0.5 kg where 2 mu squeeze is above its weight."""
    box = {"squeeze": (0.0, 20.0), "mu": (0.0, 0.4)}
    found = rw.feasible_set("gripper", "dynamic-rigid", tuple(box), box=box, tol=0.1)
    data = data_of(rw.view(found, html=tmp_path / "sets.html")[0])
    squeeze, mu = (
        low + part * (high - low)
        for part, (low, high) in zip(data["opening"]["at"], box.values(), strict=True)
    )
    assert 2.0 * mu * squeeze > 0.5 * 9.81
    assert data["opening"]["at"] in [run["at"] for run in data["runs"]]


def data_of(page: Path) -> dict[str, Any]:
    found = re.search(
        r'<script type="application/json" id="data">(.*?)</script>', page.read_text("utf-8"), re.DOTALL
    )
    assert found is not None
    return dict(json.loads(found[1]))


@pytest.mark.long
def test_a_page_that_would_be_too_large_keeps_fewer_runs(flat: rw.FeasibleSet) -> None:
    whole = sets.page([flat])
    small = sets.page([flat], largest=len(whole) * 2 // 3)
    assert len(small) <= len(whole) * 2 // 3


@pytest.mark.long
def test_folders_of_sets_and_what_is_refused(
    found: list[rw.FeasibleSet], flat: rw.FeasibleSet, tmp_path: Path
) -> None:
    flat.save(tmp_path / "flat")
    assert rw.view(tmp_path / "flat", html=tmp_path / "flat.html")[0].read_text() == sets.page([flat])
    with pytest.raises(rw.ViewError, match="over the same parameters and box"):
        rw.view([*found, flat], html=tmp_path / "no.html")
    with pytest.raises(rw.ViewError, match="sets to html and png only"):
        rw.view(flat, gif=tmp_path / "no.gif")
    with pytest.raises(rw.ViewError, match=r"holds no result itself; these folders in it do: .*flat"):
        rw.view(tmp_path)
    with pytest.raises(rw.ViewError, match="files of their own"):
        rw.view([flat, rw.simulate("two_finger", rw.KINEMATIC)], html=tmp_path / "no.html")
