"""What the documentation shows runs: examples, benchmark and the Python of the README, in small."""

from __future__ import annotations

import importlib.util
import json
import math
import re
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise import deadline
from rungwise.world.find import world_of
from tests.pages import same

pytestmark = pytest.mark.pages

ROOT = Path(__file__).parent.parent
Patch, Printed = pytest.MonkeyPatch, pytest.CaptureFixture[str]


def script(path: str, monkeypatch: Patch) -> ModuleType:
    """The script as a module, with its own folder on the path as when it is run."""
    file = ROOT / path
    monkeypatch.syspath_prepend(str(file.parent))
    spec = importlib.util.spec_from_file_location(f"script_{file.stem}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def whole_words(monkeypatch: Patch) -> None:
    """No figure that is saved here is cut off at its edge."""
    figure = pytest.importorskip("matplotlib.figure").Figure
    save = figure.savefig

    def checked(self: Any, *given: Any, **options: Any) -> None:
        save(self, *given, **options)
        drawn, (width, height) = self.get_tightbbox(), self.get_size_inches()
        slack = 0.06  # inches of empty room around legends
        assert min(drawn.x0, drawn.y0) > -slack and max(drawn.x1 - width, drawn.y1 - height) < slack

    monkeypatch.setattr(figure, "savefig", checked)


def test_demo_prints_what_the_readme_shows_saves_runs_and_draws(
    tmp_path: Path, monkeypatch: Patch, capsys: Printed
) -> None:
    demo = script("examples/two_finger_ladder.py", monkeypatch)
    monkeypatch.setattr(demo, "FAN", (0.45, 0.9))
    assert demo.main(["--out", str(tmp_path)], ratios=(0.45, 0.55, 0.9)) == 0
    printed = capsys.readouterr().out
    (shown,) = re.findall(
        r"^ {5}rung.*\n(?: {4}.*\n)+", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE
    )
    lines = [line.strip() for line in printed.splitlines()]
    for line in shown.splitlines():
        assert any(same(said, line) for said in lines), line
    moving = [rung.name for rung in rw.LADDER if rung.moves]
    assert all(name in printed for name in moving)
    assert "frictional certificate" in printed
    for name in moving:
        run = rw.load_run(tmp_path / "two_finger" / name)
        assert run.outcome == "goal" and run.trajectory.sizes["time"] > 2
    assert (tmp_path / "two_finger.png").stat().st_size > 10_000


@pytest.mark.long
def test_bands_agree_with_their_closed_forms(monkeypatch: Patch) -> None:
    bands = script("examples/bands.py", monkeypatch)
    scene = rw.load("two_finger")
    for case in bands.cases():
        measured = bands.band(scene, case, bisections=10)
        slack = 2.0 * case.step + measured.bracket
        low, high = case.expected
        assert low - slack <= measured.lower <= high + slack, case
        assert low - slack <= 1.0 / measured.upper <= high + slack, case


def test_bands_prints_every_case(monkeypatch: Patch, capsys: Printed) -> None:
    bands = script("examples/bands.py", monkeypatch)
    assert bands.main(["--json"], bisections=1) == 0
    assert len(json.loads(capsys.readouterr().out)["bands"]) == len(bands.cases())


@pytest.mark.long
def test_sensitivities_of_a_push_are_the_differences_of_runs(monkeypatch: Patch, capsys: Printed) -> None:
    example = script("examples/sensitivity.py", monkeypatch)
    monkeypatch.setattr(example, "STEP", 3.0 * example.STEP)
    monkeypatch.setattr(example, "STEPS", example.STEPS // 3)
    assert example.main(["--json"], models=(rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT)) == 0
    rigid, compliant = json.loads(capsys.readouterr().out)["rows"]
    assert rigid["derivatives"] == pytest.approx([1.5, 0.0, 0.0], abs=1e-9)
    assert compliant["derivatives"] == pytest.approx(compliant["differences"], rel=1e-6)
    # The finger touches at 1 and pushes by v1 t - 1 / 2 - 1: one step of Newton's method, and one to see it.
    assert rigid["v1"] == pytest.approx(1.6 / 1.5, abs=1e-9) and rigid["iterations"] == 2


def test_benchmark_measures_every_rung(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/run.py", monkeypatch)
    assert benchmark.main(["--json"], ratios=(0.6, 1.4), repeats=1, with_command=False) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {rung.name for rung in rw.LADDER if rung.moves} <= {row["model"] for row in rows}
    assert all(row["steps_per_s"] > 0.0 for row in rows)


def test_benchmark_of_work_and_precision(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/work_precision.py", monkeypatch)
    assert benchmark.main(["--json"], tols=(1e-3, 1e-4), repeats=1, shipped=("two_finger",)) == 0
    found = json.loads(capsys.readouterr().out)
    assert all(found["orders"][f"drag {rung.name}"] > 1.3 for rung in rw.LADDER if rung.moves)
    assert found["ratios"] and all(row["mean"] < 4.0 for row in found["ratios"] if row["what"] == "solves")


def test_random_pushes_keep_what_tol_promises_in_any_frame(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/promise.py", monkeypatch)
    assert benchmark.main(["--json", "--pushes", "6"], fine=1e-7, repeats=1) == 0
    found = json.loads(capsys.readouterr().out)
    assert all(row["median"] < 3.0 for row in found["kept"])
    assert len(found["turned"]) == 5
    for row in found["turned"]:
        assert row["runs"] >= 4 and row["other_steps"] == 0 and row["greatest"] < 1e-3


def test_hierarchy_benchmark(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/hierarchy.py", monkeypatch)
    assert benchmark.main(["--scenes", "two_finger_free"], samples=0) == 0
    assert "two_finger_free: 1 run;" in capsys.readouterr().out


def test_derivatives_are_timed(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/derivatives.py", monkeypatch)
    benchmark.main(["--scenes", "ball", "--rungs", "dynamic-rigid", "--time", "0.01"])
    row = capsys.readouterr().out.splitlines()[1].split()
    assert row[:3] == ["ball", "dynamic-rigid", "18"] and float(row[4]) > 0.0


def test_ways_of_steering_are_compared(monkeypatch: Patch, capsys: Printed, tmp_path: Path) -> None:
    benchmark = script("benchmarks/steering.py", monkeypatch)
    told = ["--tasks", "planar_hand", "--rungs", "dynamic-compliant", "--seeds", "1", "--limit", "2"]
    benchmark.main([*told, "--folder", str(tmp_path), "--drawn"])
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    assert [row[2] for row in rows] == ["drawn", "sampled", "derived"]
    assert rows[1][7] == "1.00" and [row[9] for row in rows] == ["0", "0", "0"] and int(rows[2][10]) > 0


def test_piles_are_timed(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/piles.py", monkeypatch)
    monkeypatch.setattr(benchmark, "FALLEN", 20)
    benchmark.main(["--bodies", "21", "36", "--steps", "3", "--fall", "22"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 13 and lines[1].split()[:3] == ["21", "72", "dynamic-rigid"]
    assert lines[11].split()[:2] == ["22", "dynamic-rigid"]


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "name",
    [
        "card",
        "book",
        "corner_pivot",
        "corridor",
        "planar_hand",
        "floor_push",
        "hand_turn",
        "door",
        "palm_lift",
        "ball_turn",
        "peg_arm",
    ],
)
def test_the_benchmark_of_feedback_varies_starts(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies are apart at all starts, and object and robot are elsewhere."""
    scene = script("benchmarks/feedback.py", monkeypatch).varied(name)
    errors = [each for each in scene.file.task.uncertain if each.startswith("error_")]
    low = {each: scene.file.task.uncertain[each].uniform[0] for each in errors}
    start, other = rw.State.of(scene), rw.State.of(scene, parameters=low)
    assert errors and not rw.geometry(scene, other, low).collides[0]
    assert abs(start.q - other.q).max() == pytest.approx(max(abs(x) for x in low.values()), rel=0.6)
    robots = [
        k for k, label in enumerate(start.names) if world_of(scene).roles()[label.split(".")[0]] == "robot"
    ]
    assert name == "planar_hand" or abs(start.q - other.q)[robots].max() > 1e-3
    assert ("hole_x" in scene.file.task.uncertain) == (name == "peg_arm")


def test_the_benchmark_of_feedback_counts_on_a_part_of_friction(monkeypatch: Patch) -> None:
    """Times the inverse it is the friction that there is; with all of it tasks stay as they are."""
    times, own = script("benchmarks/feedback.py", monkeypatch).times, rw.load("hand_turn").parameters()
    counted = times(own, 0.8)
    assert counted and all(counted[key] == 0.8 * own[key] and key.startswith("mu") for key in counted)
    assert times(own | counted, 1.25) == pytest.approx({key: own[key] for key in counted})
    assert times(own, 1.0) == {}


def test_places_of_the_pin_of_the_part_feeder(monkeypatch: Patch, tmp_path: Path, capsys: Printed) -> None:
    example = script("examples/part_feeder.py", monkeypatch)
    assert example.main(["--samples", "4", "--grid", "1", "--png", str(tmp_path / "map.png")]) == 0
    assert "100.0" in capsys.readouterr().out and (tmp_path / "map.png").stat().st_size > 20_000
    benchmark = script("benchmarks/part_feeder.py", monkeypatch)
    assert benchmark.main(["--fresh", "10", "--budget", "120", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert all(row["successes"] >= 8 for row in found["rows"].values())


def test_benchmark_of_sets(monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/sets.py", monkeypatch)
    assert benchmark.main(["--json"], runs=40, peer_runs=0, tols=(1 / 16, 1 / 32)) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["rows"]) == len(benchmark.CASES) and all(row["right"] == 1.0 for row in found["rows"])
    assert found["costs"][1]["part_of_grid"] < found["costs"][0]["part_of_grid"]


def test_benchmark_of_published_tasks(tmp_path: Path, monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/published_tasks.py", monkeypatch)
    benchmark.main(["--folder", str(tmp_path)])
    assert capsys.readouterr().out == f"no scenes in {tmp_path}: nothing is planned\n"
    (tmp_path / "push_ahead.yaml").write_text(rw.load("two_finger").yaml(), "utf-8")
    (tmp_path / "README.md").write_text("| file | published |\n|---|---|\n| `push_*` | in 2 s |\n", "utf-8")
    benchmark.main(["--folder", str(tmp_path), "--seeds", "1"])
    row, told = capsys.readouterr().out.splitlines()[1:]
    assert row.split()[:4] == ["two_finger", "1", "of", "1"]
    assert row.split()[-1] == "1"
    assert told == "  its authors: in 2 s"


def test_objects_of_the_panda_begin_and_end_apart_from_posts(monkeypatch: Patch) -> None:
    benchmark = script("benchmarks/panda_objects.py", monkeypatch)
    mujoco = pytest.importorskip("mujoco")
    default = {"goal_x": 0.5, "goal_y": 0.18, "turn": 60.0}
    for case in benchmark.CASES.values():
        model = mujoco.MjModel.from_xml_string(case.model)
        data = mujoco.MjData(model)
        x, y, turn = (default | case.goal).values()
        half = math.radians(turn) / 2.0
        for q in (data.qpos.copy(), [x, y, benchmark.HIGH, math.cos(half), 0.0, 0.0, math.sin(half)]):
            data.qpos[:] = q
            mujoco.mj_forward(model, data)
            assert (data.contact.dist > -1e-9).all() and data.ncon >= 4  # it lies on the table alone
            assert all(model.geom("table").id in pair for pair in data.contact.geom)


def test_benchmark_of_objects_of_the_panda(monkeypatch: Patch, capsys: Printed) -> None:
    """With a task of another robot in place of its own, which needs example-robot-data."""
    benchmark = script("benchmarks/panda_objects.py", monkeypatch)
    monkeypatch.setattr(benchmark, "scene_of", lambda *_: rw.load("two_finger"))
    benchmark.main(["--tasks", "cross", "--seeds", "1"])
    _, one, two, told = capsys.readouterr().out.splitlines()
    assert one.split()[:4] == ["cross", "1", "of", "1"] and two.split()[0] == "cross_two_posts"
    assert told == "planned: 2 of 2"


@pytest.mark.long
@pytest.mark.parametrize("name", ["ell", "cross", "box"])
def test_a_panda_pushes_other_objects_than_it_was_built_for(name: str, monkeypatch: Patch) -> None:
    benchmark = script("benchmarks/panda_objects.py", monkeypatch)
    try:
        assert benchmark.print_case(name, benchmark.CASES[name], [0], 300.0) == 1
    except rw.SceneError as error:
        if "example-robot-data" not in str(error):
            raise
        pytest.skip("the model of the arm needs example-robot-data: pip install example-robot-data")


def test_longer_tasks_can_be_planned_by_contact_modes(monkeypatch: Patch) -> None:
    """Each begins with bodies apart, away from its goal, and may take more moves than its model."""
    longer = script("benchmarks/longer_tasks.py", monkeypatch).longer(Path("nowhere"))
    assert len({scene.name for scene in longer}) == len(longer) == 4
    published = script("benchmarks/published_tasks.py", monkeypatch)
    for scene in longer:
        assert published.suits_modes(scene)
        assert scene.file.task is not None and scene.file.task.moves[1] > 12
        assert rw.simulate(scene, "quasistatic-rigid", duration=0.1).outcome == rw.Outcome.MISSED


def test_kinds_for_the_ladder_can_be_planned_by_contact_modes(monkeypatch: Patch) -> None:
    """Each member begins away from its goal; limits by the processor's clock end there alone."""
    kinds = script("benchmarks/ladder_kinds.py", monkeypatch)
    published = script("benchmarks/published_tasks.py", monkeypatch)
    for kind in kinds.KINDS:
        scenes = kinds.members(kind)
        assert len({scene.name for scene in scenes}) == len(scenes) == 3
        for scene in scenes if kind in ("clutter", "soft") else scenes[:1]:
            assert published.suits_modes(scene)
            assert rw.simulate(scene, "quasistatic-rigid", duration=1e-3).outcome == rw.Outcome.MISSED
    before = time.monotonic
    with kinds.by_processor():
        assert deadline.time.monotonic is time.process_time
    assert deadline.time.monotonic is before


@pytest.mark.long
def test_costs_of_contact_modes_are_counted_on_both_rungs(
    tmp_path: Path, monkeypatch: Patch, capsys: Printed
) -> None:
    """Trees, legs and runs take less than the whole."""
    costs = script("benchmarks/mode_costs.py", monkeypatch)
    costs.main(["--folder", str(tmp_path), "--seeds", "1", "--tasks", "corner"])
    rows = [row.split() for row in capsys.readouterr().out.splitlines()[1:]]
    assert [row[:2] for row in rows] == [
        ["corner_pivot", name] for name in ("quasistatic-rigid", "dynamic-compliant")
    ]
    for row in rows:
        assert row[2:5] == ["1", "of", "1"] and int(row[6]) > 0 and int(row[9]) > 0 and int(row[12]) > 0
        assert 0 < sum(int(part.rstrip("%")) for part in (row[8], row[11], row[14])) <= 101


def test_relatives_are_told_where_there_are_none(tmp_path: Path, monkeypatch: Patch, capsys: Printed) -> None:
    benchmark = script("benchmarks/published_tasks.py", monkeypatch)
    (tmp_path / "other.yaml").write_text(rw.load("corner_pivot").yaml(), "utf-8")
    benchmark.main(["--folder", str(tmp_path), "--seeds", "1", "--relatives", "1"])
    assert capsys.readouterr().out.splitlines()[1:] == [
        f"{'other':36} has no relatives",
        "planned from every seed: 0 of 0 relatives",
    ]


@pytest.mark.parametrize("number", range(2))
def test_a_relative_is_the_same_kind_of_task(number: int, monkeypatch: Patch) -> None:
    """A block at a wall stays there, its finger beside it; fingers do not feel another gravity either."""
    relatives = script("benchmarks/relatives.py", monkeypatch)
    task: dict[str, Any] = {
        "name": "hidex_corner_pivot", "gravity": [0, -9.81],
        "parameters": {"x1": {"default": -0.085}},
        "bodies": {
            "finger1": {
                "role": "robot", "mass": 0.1, "force": [0, 0.981], "shape": {"kind": "disc", "radius": 0.005}
            },
            "part": {
                "role": "object", "mass": 1.0, "shape": {"kind": "box", "width": 0.08, "height": 0.03},
                "pose": {"x": -0.04, "y": 0.015},
            },
            "wall": {
                "role": "obstacle", "shape": {"kind": "box", "width": 0.03, "height": 0.04},
                "pose": {"x": 0.015, "y": 0.02},
            },
        },
        "contacts": [{"between": ["finger1", "part"], "friction": 0.5}], "task": {},
    }  # fmt: skip
    found = relatives.relative(task, number)
    assert found == relatives.relative(task, number) != relatives.relative(task, number + 1)
    part, finger = found["bodies"]["part"], found["bodies"]["finger1"]
    assert 0.8 * 0.08 <= part["shape"]["width"] <= 1.2 * 0.08
    assert part["pose"]["x"] + part["shape"]["width"] / 2 == pytest.approx(0.0, abs=1e-12)
    assert part["pose"]["y"] == part["shape"]["height"] / 2
    assert found["parameters"]["x1"]["default"] == pytest.approx(-part["shape"]["width"] - 0.005)
    assert finger["force"][1] == pytest.approx(-0.1 * found["gravity"][1])
    assert task["contacts"][0]["friction"] == 0.5 != found["contacts"][0]["friction"]
    assert relatives.relative(task | {"name": "other"}, 0) is None


def test_ladder_and_contact_modes_are_compared_on_a_task(
    tmp_path: Path, monkeypatch: Patch, capsys: Printed
) -> None:
    benchmark = script("benchmarks/published_tasks.py", monkeypatch)
    arms = rw.load("planar_hand").file.model_dump(mode="json", exclude_unset=True)
    del arms["task"]["fingers"]
    for bounds in arms["task"]["inputs"].values():
        bounds.pop("rate", None)
    (tmp_path / "corner_arms.yaml").write_text(rw.load(arms | {"name": "corner_arms"}).yaml(), "utf-8")
    only = ["--folder", str(tmp_path), "--tasks", "corner", "--seeds", "1", "--limit", "1"]
    benchmark.main([*only, "--schedules"])
    left_out, *rows = capsys.readouterr().out.splitlines()[1:]
    assert left_out.split(maxsplit=1) == ["corner_arms", "inputs alone lead its robots: no contact modes"]
    assert [row[35:57].strip() for row in rows[:4]] == list(benchmark.WAYS)
    assert all(row.startswith("corner_pivot") for row in rows[:4])
    numbers = [row[57:].replace(">", " ").split() for row in rows[:4]]
    assert numbers[0][5] == "1.00"
    assert 0.0 < float(numbers[0][6]) <= float(numbers[0][4])
    assert int(numbers[0][7]) > 0 and int(numbers[1][7]) == int(numbers[3][7]) == 0  # steps of the lower rung
    assert rows[4].endswith("of 1 tasks")


def test_ladder_pays_where_no_other_way_finds_a_plan(monkeypatch: Patch) -> None:
    benchmark = script("benchmarks/published_tasks.py", monkeypatch)
    lost, slow, fast = (
        benchmark.Tally(solved=solved, seconds=[seconds] * 2, searching=[seconds] * 2)
        for solved, seconds in ((1, 20.0), (2, 8.0), (2, 2.0))
    )
    for tally in (lost, slow, fast):
        tally.steps = {name: [1, 1] for name in tally.steps}
    assert benchmark.print_tallies("task", {"first": fast, "second": lost, "third": slow}) == 4.0
    assert benchmark.print_tallies("task", {"first": fast, "second": lost}) == math.inf
    assert benchmark.print_tallies("task", {"first": lost, "second": slow}) == 0.0


@pytest.mark.parametrize(
    ("kinds", "first"),
    [(("surface", "dry"), 1004), pytest.param(("surface", "dry", "drag"), 1003, marks=pytest.mark.long)],
)
def test_push_is_planned_with_every_kind_of_resistance(
    kinds: tuple[str, ...],
    first: int,
    tmp_path: Path,
    monkeypatch: Patch,
    capsys: Printed,
) -> None:
    supports = script("examples/push_supports.py", monkeypatch)
    drag = rw.load(supports.scene("drag"))
    assert isinstance(drag, rw.Scene) and not len(drag.bind().records.supports)
    monkeypatch.setattr(supports, "RESISTANCE", {kind: supports.RESISTANCE[kind] for kind in kinds})
    assert supports.main(["--instances", "1", "--first", str(first), "--out", str(tmp_path)]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(supports.RESISTANCE)
    kept = rw.load(tmp_path / f"push_{kinds[-1]}.yaml")
    assert kept.file.task is not None


def test_figure_2(monkeypatch: Patch, tmp_path: Path, capsys: Printed) -> None:
    """Caught is form closure; a jam by friction is force closure alone; what slips out is held by neither."""
    figure = script("examples/figure2.py", monkeypatch)
    assert figure.main(["--out", str(tmp_path)]) == 0
    assert (tmp_path / "figure2.png").stat().st_size > 20_000
    said = [line for line in capsys.readouterr().out.splitlines() if "mu = " in line]
    page = (ROOT / "docs" / "results.md").read_text("utf-8").splitlines()
    assert len(said) == 3 and all(any(same(line, kept) for kept in page) for line in said)
    runs = [grasp.run() for grasp in figure.GRASPS]
    found = [figure.held(run) for run in runs]
    assert [hold.verdict for hold in found] == [figure.FORM, figure.FORCE, figure.NEITHER]
    assert [len(hold.contacts.others) for hold in found] == [4, 3, 2]
    assert runs[1].outcome == "jammed" and runs[1].certificate is not None
    # Four contacts close the part without friction; fewer than four cannot.
    assert found[0].free is None and found[1].free is found[1].form


def test_figure_1(monkeypatch: Patch, tmp_path: Path, capsys: Printed) -> None:
    """Feasible and doomed states are apart; the feasible ones are those of the closed form, |x3| < 1/2."""
    figure = script("examples/figure1.py", monkeypatch)
    arguments = ["--points", "41", "--cells", "16", "--speeds", "3", "--out", str(tmp_path)]
    assert figure.main(arguments) == 0
    assert (tmp_path / "figure1.png").stat().st_size > 20_000
    first = capsys.readouterr().out.splitlines()[0]
    parts = {part.split()[0]: float(part.split()[-1]) for part in first.split(": ", 1)[1].split(", ")}
    assert 0.15 < parts["feasible:"] < 0.2 and parts["doomed:"] > 0.4


def test_three_fingers_lift_a_ball_where_there_is_friction(
    tmp_path: Path, monkeypatch: Patch, capsys: Printed
) -> None:
    drawn = tmp_path / "space.png"
    assert script("examples/space_frames.py", monkeypatch).main([str(drawn)]) == 0
    assert capsys.readouterr().out.splitlines() == ["kinematic: missed", "dynamic-compliant: goal"]
    assert drawn.stat().st_size > 20_000


def test_race_without_the_others(monkeypatch: Patch, capsys: Printed) -> None:
    race = script("benchmarks/race.py", monkeypatch)
    # Some of them fail on import where every warning is an error.
    monkeypatch.setattr(race.peers, "peers", list)
    assert race.main(["--json"], ratios=(0.4, 1.3), steps=(5e-3,), repeats=1) == 0
    found = json.loads(capsys.readouterr().out)
    own = {rung.name for rung in rw.LADDER if rung.moves}
    assert own <= {row["engine"] for row in found["grasps"]}
    assert all(row["wrong"] == 0 for row in found["grasps"] if row["engine"] in own)
    slid = {row["engine"]: row for row in found["slidings"]}
    assert slid["dynamic-rigid"]["creep"] < 1e-12 and slid["dynamic-rigid"]["lift"] < 1e-12
    assert slid["dynamic-compliant"]["creep"] < 1e-5 and slid["dynamic-compliant"]["lift"] == 0.0
    assert all(slid[name]["acceleration_error"] < 5e-3 for name in ("dynamic-rigid", "dynamic-compliant"))


def test_pushes_without_the_others(monkeypatch: Patch, capsys: Printed) -> None:
    pushes = script("benchmarks/pushes.py", monkeypatch)
    monkeypatch.setattr(pushes, "find_spec", lambda _: None)
    assert pushes.main(["--runs", "5", "--json"], repeats=1) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {row["engine"] for row in rows} == {rung.name for rung in rw.LADDER if rung.moves}
    assert all(row["error"] <= pushes.ALLOWED and row["steps"] <= 4 for row in rows)


def test_squeezes_orient_a_part(monkeypatch: Patch, capsys: Printed) -> None:
    squeezes = script("benchmarks/squeeze.py", monkeypatch)
    monkeypatch.setattr(squeezes, "BISECTIONS", 2)
    assert squeezes.main(["--samples", "50", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["alike"] == 50 and found["greatest"] == found["predicted"]
    assert all(said == predicted for _, said, predicted in found["rows"])


def test_a_push_is_found_in_many_environments(monkeypatch: Patch, capsys: Printed) -> None:
    example = script("examples/gym_push.py", monkeypatch)
    assert example.main(["--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    ends = {row["model"]: row["success"] for row in found["rows"]}
    assert found["returns"][-1] > 1.0 and ends["quasistatic-rigid"] and ends["dynamic-rigid"]
    benchmark = script("benchmarks/gym.py", monkeypatch)
    assert benchmark.main(["--envs", "3", "--steps", "2", "--json"], rounds=1) == 0
    assert all(row["same"] for row in json.loads(capsys.readouterr().out))


def test_guarded_moves_find_a_hole_without_chamfers(monkeypatch: Patch, capsys: Printed) -> None:
    example = script("examples/peg_in_hole.py", monkeypatch)
    monkeypatch.setattr(example, "FRICTIONS", (0.2,))
    assert example.main(["--samples", "40", "--json"]) == 0
    ((_, straight, guarded),) = json.loads(capsys.readouterr().out)["rows"]
    assert straight < 10 and guarded >= 36


def test_a_clip_snaps_at_the_force_of_the_closed_form(
    tmp_path: Path, monkeypatch: Patch, capsys: Printed
) -> None:
    example = script("examples/snap.py", monkeypatch)
    monkeypatch.setattr(example, "CASES", ((0.14, 1.0, 0.2),))
    assert example.main(["--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    for row in found["rungs"]:
        assert row["outcome"] == ("goal" if "force" in row else "jammed")
        assert math.isclose(row.get("force", 1.0), row.get("predicted", 1.0), rel_tol=2e-3)
    (row,) = found["loads"]
    assert all(math.isclose(row[way], row[f"{way}_predicted"], rel_tol=1e-3) for way in ("in", "out"))
    assert example.main(["--figure", str(tmp_path / "snap.png")]) == 0
    assert (tmp_path / "snap.png").stat().st_size > 10_000


def test_pegs_slide_and_jam_as_the_parallelogram_says(monkeypatch: Patch, capsys: Printed) -> None:
    """Loads 2 % within it and beyond; two points hold a peg whatever the load iff it leans by c / mu."""
    jamming = script("benchmarks/jamming.py", monkeypatch)
    assert jamming.main(["--cases", "40", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert sum(count for _, count, *_ in found["sides"]) == 40
    assert all(count == slid == jammed > 0 for _, count, slid, jammed in found["sides"])
    assert found["held"] == found["free"] == 40


ELSEWHERE = {"tutorial.md"}
"""Pages whose code `tests/test_newcomer.py` runs."""
PAGES = sorted(
    page.name
    for page in (ROOT / "docs").glob("*.md")
    if "```python" in page.read_text("utf-8") and page.name not in ELSEWHERE
)


@pytest.mark.parametrize("page", PAGES)
def test_python_of_the_documentation_runs_and_prints(
    page: str,
    tmp_path: Path,
    monkeypatch: Patch,
    capsys: Printed,
) -> None:
    text = (ROOT / "docs" / page).read_text("utf-8")
    (tmp_path / "examples").symlink_to(ROOT / "examples")  # as in a checkout
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(block, page, "exec"), names)
    said = capsys.readouterr().out
    assert said == "".join(re.findall(r"```text\n(.*?)```", text, re.DOTALL))


def test_every_scene_file_of_the_documentation_loads() -> None:
    for name in ("docs/scene.md",):
        for block in re.findall(r"```yaml\n(name:.*?)```", (ROOT / name).read_text("utf-8"), re.DOTALL):
            import yaml

            scene = rw.load(yaml.safe_load(block))
            scene.bind()


def test_painleves_rod_has_no_acceleration_beyond_its_closed_form(
    monkeypatch: Patch, capsys: Printed
) -> None:
    rod = script("examples/painleve.py", monkeypatch)
    least = math.atan(2.0)
    assert rod.threshold(least) == pytest.approx(4.0 / 3.0)
    assert all(rod.threshold(least + turn) > 4.0 / 3.0 for turn in (-0.01, 0.01))
    for angle in (math.radians(35.0), least, math.radians(80.0)):
        for rising in (False, True):
            found = rod.measured(angle, rod.Rod.accelerations, rising)
            assert found == pytest.approx(rod.threshold(angle), abs=rod.HIGHEST * 2.0**-rod.BISECTIONS)
    monkeypatch.setattr(rod, "ANGLES", (60.0,))
    assert rod.main(["--json"]) == 0
    row = json.loads(capsys.readouterr().out)["rows"][0]
    assert row["no_acceleration"] < row["three_steps"] and row["pressed_steps"] == 1


def test_painleves_rod_has_one_or_three_steps(monkeypatch: Patch, tmp_path: Path) -> None:
    rod = script("examples/painleve.py", monkeypatch)
    for degrees in (20.0, 63.0):
        for mu in (0.3, 1.35, 1.7, 2.5):
            pressed, rising = (rod.Rod(math.radians(degrees), mu, rises) for rises in (False, True))
            assert rod.number(pressed.step()) == 1
            assert rod.number(rising.step()) == (3 if rising.stops() else 1)
            expected = (1, 1) if mu < rod.threshold(pressed.angle) else (0, 2)
            assert (rod.number(pressed.accelerations()), rod.number(rising.accelerations())) == expected
    monkeypatch.setattr(rod, "GRID", 3)
    assert rod.main(["--figure", str(tmp_path / "rod.png")]) == 0
    assert (tmp_path / "rod.png").stat().st_size > 10_000


def test_controllers_keep_a_box_on_its_course_and_grasp_by_touch(monkeypatch: Patch, capsys: Printed) -> None:
    example = script("examples/feedback.py", monkeypatch)
    assert example.main(["--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["outcome"] for row in found["pushes"] if row["led"]} == {"goal"}
    assert all(abs(row["turned"]) > 1.0 for row in found["pushes"] if not row["led"])


@pytest.mark.long
def test_a_policy_leads_mujoco_to_the_goal(monkeypatch: Patch, capsys: Printed) -> None:
    script("examples/policy_in_mujoco.py", monkeypatch).main()
    assert "with policy: goal" in capsys.readouterr().out


def test_in_mujoco_inputs_lead_the_controls_that_the_scene_names(monkeypatch: Patch) -> None:
    """The actuators of the arm have other names than the inputs."""
    example, scene = script("examples/policy_in_mujoco.py", monkeypatch), rw.load("arm_turn")
    plan: Any = SimpleNamespace(scene=scene, parameters=scene.parameters())
    shoulder, seen = scene.template.coordinates.index("upper.shoulder"), list[float]()

    def levels(state: rw.State) -> Any:
        seen.append(float(state.q[shoulder]))
        wanted = plan.parameters | {"shoulder_to": plan.parameters["shoulder_to"] + 0.2}
        return np.array([wanted[name] for name in scene.template.inputs])

    assert example.run(plan, levels, 0.05, 0.5) == "missed"
    assert 0.05 < abs(seen[-1] - seen[0]) < 0.3


def test_fingers_in_space_hold_on_rungs_with_forces(monkeypatch: Patch, capsys: Printed) -> None:
    example = script("examples/fingers_in_space.py", monkeypatch)
    assert example.main(["floor_push"]) == 0
    printed = capsys.readouterr().out
    for model in rw.LADDER[2:]:
        assert re.search(rf"{model.name} +goal", printed)
