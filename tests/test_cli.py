"""The command line: JSON, exit codes, and one line for whatever is wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import numpy as np
import pytest
import typer.main
import yaml

import rungwise as rw
from rungwise import cli
from rungwise.compilation.progress import compiling
from rungwise.scene.space.read import shipped_in_space


class Answer(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as one JSON object, by a reader that knows no NaN or Infinity."""
        assert self.err == ""
        return json.loads(self.out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


Command = Callable[..., Answer]


@pytest.fixture
def rungwise(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The command, run in this process."""

    def run(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["rungwise", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        captured = capsys.readouterr()
        return Answer(int(ended.value.code or 0), captured.out, captured.err)

    monkeypatch.setattr(compiling, "tell", lambda _: None)
    return run


def refused(answer: Answer, *words: str) -> None:
    assert answer.code == 2
    assert answer.out == "" or json.loads(answer.out) == {"error": answer.err[len("rungwise: ") : -1]}
    assert answer.err.startswith("rungwise: ") and answer.err.endswith("\n")
    assert answer.err.count("\n") == 1 and len(answer.err) < 600
    assert "Traceback" not in answer.err
    for word in words:
        assert word.lower() in answer.err.lower()


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a variant of a small scene: a finger that pushes a block along a floor."""

    def write(**changes: object) -> Path:
        scene: dict[str, Any] = {
            "name": "push",
            "parameters": {"v": {"default": 1.0, "range": [0.1, 2.0]}, "gap0": {"default": 0.5}},
            "bodies": {
                "finger": {
                    "role": "robot",
                    "shape": {"kind": "point"},
                    "motion": {"kind": "slide", "axis": [1, 0]},
                    "coordinates": {"s": {"upper": 5, "drive": {"kind": "speed", "speed": "v"}}},
                },
                "block": {
                    "role": "object",
                    "shape": {"kind": "box", "width": 1, "height": 1},
                    "pose": {"x": "0.5 + gap0"},
                    "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
                },
            },
            "contacts": [{"between": ["finger", "block"]}],
            "goal": "block.x >= 0.25",
            "duration": 2,
            "step": 0.01,
        }
        path = tmp_path / "push.yaml"
        path.write_text(yaml.safe_dump(scene | changes, sort_keys=False))
        return path

    return write


def test_models(rungwise: Command) -> None:
    answer = rungwise("models", "--json")
    assert answer.code == 0
    assert [model["name"] for model in answer.json["models"]] == [rung.name for rung in rw.LADDER]
    text = rungwise("models")
    assert text.code == 0 and text.err == ""
    assert all(rung.name in text.out for rung in rw.LADDER)


def test_scenes(rungwise: Command) -> None:
    answer = rungwise("scenes", "--json")
    assert answer.code == 0
    assert set(answer.json["scenes"]) == {*rw.shipped(), *shipped_in_space()}
    text = rungwise("scenes")
    assert text.code == 0 and "two_finger" in text.out


def test_schema(rungwise: Command) -> None:
    for answer in (rungwise("scenes", "--schema"), rungwise("scenes", "--schema", "--json")):
        assert answer.code == 0
        assert answer.json == json.loads(json.dumps(rw.schema()))
    assert {"name", "bodies", "goal"} <= set(rw.schema()["properties"])


@pytest.mark.few(1)
@pytest.mark.parametrize("name", rw.shipped())
def test_check(rungwise: Command, name: str) -> None:
    answer = rungwise("check", name, "--json")
    assert answer.code == 0
    assert {"scene", "bodies", "contacts", "parameters", "goal"} <= set(answer.json)
    text = rungwise("check", name)
    assert text.code == 0 and text.err == "" and name in text.out


def test_check_shows_what_joints_leave_free(rungwise: Command) -> None:
    text = rungwise("check", "two_link").out
    assert "elbow        hinge  upper | lower  travels -2.61799 to 2.61799 rad, driven by a servo: " in text
    elbow = rungwise("check", "two_link", "--json").json["joints"]["elbow"]["coordinate"]
    assert elbow["drive"] == "servo" and elbow["upper"] == pytest.approx(np.radians(150))


def test_check_reports_given_values_and_no_bound_as_null(rungwise: Command) -> None:
    report = rungwise("check", "two_finger", "--set", "v2=0.5", "--set", "mass=3", "--json").json
    assert report["parameters"]["v2"]["value"] == 0.5
    assert report["bodies"]["part"]["mass"] == 3.0
    assert report["bodies"]["part"]["coordinates"]["x3"]["upper"] is None


def test_sim(rungwise: Command) -> None:
    answer = rungwise("sim", "two_finger", "--model", "kinematic", "--set", "v2=0.9", "--json")
    report = answer.json
    fields = [
        "scene",
        "model",
        "parameters",
        "outcome",
        "reason",
        "time",
        "steps",
        "final",
        "worst_residual",
        "wall_s",
    ]
    assert set(fields) <= set(report)
    assert answer.code == 0
    assert (report["scene"], report["model"], report["outcome"]) == ("two_finger", "kinematic", "goal")
    assert report["parameters"]["v2"] == 0.9 and report["steps"] > 0 and report["time"] > 0
    assert set(report["final"]) == {"finger1", "finger2", "part"} and set(report["final"]["part"]) == {"x3"}
    text = rungwise("sim", "two_finger", "--model", "kinematic")
    assert text.code == 0 and text.err == "" and "two_finger on kinematic: goal" in text.out


def test_sim_answers_no(rungwise: Command) -> None:
    answer = rungwise("sim", "two_finger", "--model", "kinematic", "--set", "v2=0.1", "--json")
    assert answer.code == 1
    assert answer.json["outcome"] in ("doomed", "missed")
    short = rungwise("sim", "two_finger", "--model", "kinematic", "--time", "0.01", "--json")
    assert short.code == 1 and short.json["outcome"] in ("timeout", "missed")


SIM = ("sim", "two_finger", "--model", "kinematic")
WRONG: list[tuple[tuple[object, ...], tuple[str, ...]]] = [
    (("zzz",), ("zzz",)),
    (("--zzz",), ("--zzz",)),
    (("models", "zzz"), ("zzz",)),
    (("scenes", "--zzz"), ("--zzz",)),
    (("check",), ("SCENE",)),
    (("sim",), ("SCENE",)),
    (("sim", "two_finger"), ("--model",)),
    (("check", "zzz"), ("scene: 'zzz'", "two_finger")),
    (("check", "no/such.yaml"), ("scene: 'no/such.yaml'",)),
    (("check", ""), ("scene: ''", "two_finger")),
    (("check", "a\nb"), ("scene: 'a\\nb'",)),
    (("check", "/"), ("is a folder",)),
    (("check", "x" * 5000), ("scene: ",)),
    (("sim", "zzz", "--model", "kinematic"), ("scene: 'zzz'", "two_finger")),
    (("sim", "two_finger", "--model", "zzz"), ("model: ", "'zzz'", *(rung.name for rung in rw.LADDER))),
    (("sim", "two_finger", "--model", ""), ("model: ", "kinematic")),
    (("sim", "two_finger", "--model", "a\nb"), ("model: ", "kinematic")),
    (("sim", "two_finger", "--model", "geometric"), ("model: ", "geometric", "plan")),
    ((*SIM, "--set"), ("--set",)),
    ((*SIM, "extra"), ("extra",)),
]
for command in (("check", "two_finger"), SIM):
    for text in (
        "v1",
        "v1=",
        "v1=abc",
        "=1",
        "",
        "v1 1",
        "v1=1=2",
        "v1=nan",
        "v1==1",
        "v1=0x10",
        "v1=1,2",
        "a\nb",
        "v1=\n",
    ):
        WRONG.append(((*command, "--set", text), ("--set", "must be name=number; names: v1, v2")))
    WRONG += [
        ((*command, "--set", "zzz=1"), ("parameters: unknown 'zzz'", "v1, v2, mu")),
        ((*command, "--set", "v1=inf"), ("parameters.v1: must be finite",)),
        ((*command, "--set", "v1=1e999"), ("parameters.v1: must be finite",)),
        ((*command, "--set", "v1=-1"), ("parameters.v1: -1 is outside 1e-06 to 1e+06",)),
        ((*command, "--set", "v1=1", "--set", "mu=-1"), ("parameters.mu: -1 is outside",)),
    ]
for option in ("--step", "--tol", "--time"):
    for text in ("0", "-1", "nan", "inf", "-inf", "1e999", "-0"):
        WRONG.append(((*SIM, option, text), (option[2:], "must be a finite number greater than 0")))
    for text in ("abc", "", "1e", "1,5", "None"):
        WRONG.append(((*SIM, option, text), (f"'{option}'", "must be a number, not")))
for text in ("0", "0.49", "1.01", "nan", "inf", "-1"):
    WRONG.append(((*SIM, "--theta", text), ("theta", "0.5..1")))
for text in ("-0.1", "1.1", "nan", "inf"):
    WRONG.append((("sim", "two_finger", "--model", "dynamic-rigid", "--inertia", text), ("inertia", "0..1")))
WRONG += [
    ((*SIM, "--inertia", "0.5"), ("inertia: the kinematic rung has none", "quasistatic")),
    ((*SIM, "--inertia", "7"), ("inertia: the kinematic rung has none",)),
    (
        ("sim", "two_finger", "--model", "geometric", "--inertia", "1"),
        ("inertia: the geometric rung has none",),
    ),
    ((*SIM, "--theta", "abc"), ("--theta",)),
    ((*SIM, "--step", "0.1", "--tol", "0.1"), ("step and tol",)),
]


@pytest.mark.few(6)
@pytest.mark.parametrize("as_json", [(), ("--json",)], ids=["text", "json"])
@pytest.mark.parametrize(("arguments", "words"), WRONG, ids=lambda x: ascii(" ".join(map(str, x))[:60]))
def test_wrong_use(
    rungwise: Command, arguments: tuple[object, ...], words: tuple[str, ...], as_json: tuple[str, ...]
) -> None:
    refused(rungwise(*arguments, *as_json), *words)


def test_help_is_no_error(rungwise: Command) -> None:
    for arguments in ((), ("--help",), ("sim", "--help")):
        answer = rungwise(*arguments)
        assert answer.code == 0 and answer.err == "" and "Usage" in answer.out


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("code", "unwanted"),
    [("import rungwise.cli", {"numba", "scipy", "pydantic"}), ("rw.load('two_finger')", {"scipy.optimize"})],
)
def test_what_a_command_does_not_need_is_not_imported(code: str, unwanted: set[str]) -> None:
    """Help, completion and the first run would wait for it."""
    told = f"import sys, rungwise as rw; {code}; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True).stdout
    assert not unwanted & set(found.split())


def test_wrong_files(rungwise: Command, tmp_path: Path, scene_file: Callable[..., Path]) -> None:
    for content, words in (
        (b"\x00\xff", "cannot be read"),
        (b"", "must be a mapping"),
        (b"a: [", "line 1"),
        (b"a: 1\na: 2", "given twice"),
        (b"a: &x [*x]", "aliases"),
    ):
        path = tmp_path / "wrong.yaml"
        path.write_bytes(content)
        refused(rungwise("check", path), words)
        refused(rungwise("sim", path, "--model", "kinematic", "--json"), words)
    refused(rungwise("check", scene_file(goal="block.z > 1")), "goal: unknown name block.z", "block.x")
    refused(rungwise("check", scene_file(name="no name")), "name: must be a name")
    refused(rungwise("check", scene_file(zzz=1)), "scene: unknown field 'zzz'; valid: name, about")


def test_impossible_values(rungwise: Command, scene_file: Callable[..., Path]) -> None:
    path = scene_file(step="1e-2 * (v - 1)")
    for command in (("check", path), ("sim", path, "--model", "kinematic")):
        refused(rungwise(*command, "--set", "v=0.5"), "step: -0.005 must be > 0")


@pytest.mark.parametrize("model", [rung.name for rung in rw.LADDER[1:]])
def test_overlap_at_the_start(
    rungwise: Command, scene_file: Callable[..., Path], tmp_path: Path, model: str
) -> None:
    answer = rungwise("sim", scene_file(), "--model", model, "--set", "gap0=-0.25", "--out", tmp_path / "run")
    refused(answer, "bodies.finger: overlaps block by 0.25 at the start")
    assert not (tmp_path / "run").exists()


def test_check_finds_overlap_at_the_start(rungwise: Command, scene_file: Callable[..., Path]) -> None:
    path = scene_file()
    assert rungwise("check", path, "--set", "gap0=0").code == 0
    for as_json in ((), ("--json",)):
        refused(
            rungwise("check", path, "--set", "gap0=-0.25", *as_json),
            "bodies.finger: overlaps block by 0.25 at the start",
        )
    refused(rungwise("check", "two_finger", "--set", "travel=0.3"), "finger", "overlaps part", "at the start")


def test_a_scene_from_a_file(rungwise: Command, scene_file: Callable[..., Path]) -> None:
    report = rungwise("sim", scene_file(), "--model", "kinematic", "--json").json
    assert report["outcome"] == "goal"
    assert report["final"]["block"]["x"] == pytest.approx(0.25, abs=0.02)


@pytest.mark.long
def test_out_is_read_back_and_replaced_whole(rungwise: Command, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "run"
    first = rungwise(*SIM, "--out", folder, "--json").json
    saved = rw.load_run(folder)
    dataset, summary = saved.trajectory, saved.summary()
    assert summary["outcome"] == first["outcome"] == "goal"
    assert summary["parameters"] == first["parameters"]
    assert dataset.attrs["scene"] == "two_finger" and dataset.attrs["model"] == "kinematic"
    assert float(dataset.position.sel(coordinate="part.x3")[-1]) == first["final"]["part"]["x3"]
    long = dataset.sizes["time"]
    (folder / "notes.txt").write_text("kept")
    refused(rungwise(*SIM, "--out", folder, "--time", "0.001"), "out: ", "exists; --force overwrites it")
    second = rungwise(*SIM, "--out", folder, "--force", "--time", "0.001", "--json").json
    saved = rw.load_run(folder)
    dataset, summary = saved.trajectory, saved.summary()
    assert summary["outcome"] == second["outcome"] != "goal"
    assert dataset.sizes["time"] < long and float(dataset.time[-1]) == pytest.approx(0.001)
    assert np.isfinite(dataset.position).all()
    assert sorted(p.name for p in folder.iterdir()) == [
        "notes.txt",
        "run.json",
        "states.npz",
        "trajectory.zarr",
    ]


def test_every_command_with_out_refuses_what_exists_and_can_be_forced(
    rungwise: Command, tmp_path: Path
) -> None:
    commands = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
    options = {name: {p.name for p in each.params} for name, each in commands.items()}
    assert {name for name, own in options.items() if "force" in own} == {"view"} | {
        name for name, own in options.items() if "out" in own
    }
    problem = tmp_path / "problem.npz"
    rw.solve(rw.Problem.lcp([[2.0, 1.0], [1.0, 2.0]], [-1.0, -1.0])).save(tmp_path / "any.npz")
    kept = tmp_path / "kept.json"
    kept.write_text("kept")
    for command in (
        ("plan", "push", "--to", "geometric"),
        ("design", "two_finger", "--over", "v2", "--model", "kinematic"),
        ("solve", problem),
    ):
        refused(rungwise(*command, "--out", kept), "out: ", "kept.json exists; --force overwrites it")
    assert kept.read_text() == "kept"
    for command in (SIM, ("compare", "two_finger", "--samples", 0), SETS):
        refused(rungwise(*command, "--out", tmp_path), "out: ", "exists; --force overwrites it")


def test_every_option_that_names_a_file_to_write_refuses_one_that_exists(
    rungwise: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begins = {
        "design": ("two_finger", "--over", "v2", "--model", "kinematic"),
        "plan": ("push", "--to", "geometric"),
        "sets": SETS[1:],
        "sim": SIM[1:],
        "view": ("two_finger", "--model", "kinematic"),
    }
    read = ("data", "inputs", "initial", "file", "plan", "out")
    commands = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
    kept, tried = tmp_path / "kept.obj", set()
    kept.write_text("kept")
    for name, command in commands.items():
        for option in command.params:
            if option.type_descriptor.annotation is not Path or option.name in read:
                continue
            tried.add(name)
            word = option.opts[0]
            answer = rungwise(name, *begins[name], word, kept)
            refused(answer, f"{word[2:].replace('-', '_')}: ", "exists; --force overwrites it")
    assert tried == set(begins) and kept.read_text() == "kept"
    monkeypatch.chdir(tmp_path)
    for force in ((), ("--force",)):
        assert rungwise("view", *begins["view"], *force).code == 0
        refused(rungwise("view", *begins["view"]), "html: two_finger.html exists; --force overwrites it")


def test_check_prints_places_as_runs_do(rungwise: Command) -> None:
    for scene in ("gripper", "push", "two_finger", "two_link", "ball"):
        report = rungwise("check", scene, "--json").json
        state, places = rw.State.of(scene), {}
        for body, own in report["bodies"].items():
            for label, each in own["coordinates"].items():
                places |= {f"{body}.{c}": x for c, x in each.get("places", {label: each["start"]}).items()}
        assert places == pytest.approx({name: state[name] for name in state.names})
    assert "ball: free, starts at x = 0, y = 0, z = 0.1, qw = 1," in rungwise("check", "ball").out


def test_out_that_cannot_be_written(rungwise: Command, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("kept")
    refused(rungwise(*SIM, "--out"), "--out")
    for folder in (
        blocked,
        blocked / "run",
        blocked / "deep" / "run",
        "/dev/null/run",
        tmp_path / ("x" * 300),
    ):
        refused(rungwise(*SIM, "--out", folder), "out: ", "cannot be written")
    assert blocked.read_text() == "kept"
    assert list(tmp_path.iterdir()) == [blocked]


@pytest.mark.few(2)
@pytest.mark.parametrize("wrong", ["--model zzz", "--set zzz=1", "--theta 7", "--step 0", "--set travel=0.1"])
def test_out_is_left_alone_when_there_is_nothing_to_write(
    rungwise: Command, tmp_path: Path, wrong: str
) -> None:
    kept = tmp_path / "kept"
    kept.mkdir()
    for folder in (kept, tmp_path / "deep" / "run", tmp_path / "deep" / ".." / "run"):
        refused(rungwise(*SIM, *wrong.split(), "--out", folder))
    assert list(tmp_path.iterdir()) == [kept] and not list(kept.iterdir())


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may write anywhere"
)
def test_out_without_permission(rungwise: Command, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    refused(rungwise(*SIM, "--out", tmp_path / "run"), "out: ", "cannot be written")


MAIN = [sys.executable, "-c", "from rungwise.cli import main; main()"]


def test_interruption_keeps_what_was_reached(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    # A shell that starts the tests in the background has them ignore the signal; so would the child.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);" + MAIN[-1]
    telling = "from rungwise.cli import progress as p; watch = p.watch;"
    telling += "p.watch = lambda *a, **k: (print('running', flush=True), watch(*a, **k))[1];"
    command = [*MAIN[:-1], telling + listening, *SIM, "--step", "1e-9", "--json", "--out", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "running\n"
        time.sleep(3.0)
        process.send_signal(signal.SIGINT)
        began = time.monotonic()
        try:
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 130, err
    assert time.monotonic() - began < 10.0  # a second on an idle machine, most of it to import the storage
    report = json.loads(out)
    assert report["outcome"] == "running" and "Traceback" not in err
    assert rw.load_run(folder).time == report["time"]


@pytest.mark.long
def test_interrupted_search_keeps_the_plan_of_the_stage_before(tmp_path: Path) -> None:
    plan = tmp_path / "plan.json"
    # The second stage waits for the signal.
    waiting = (
        "import signal, time; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "from rungwise.planning.lift import lift; take = lift._take_stage\n"
        "def stage(work, found, stage):\n"
        "    if found.records: print('waits', flush=True); time.sleep(60)\n"
        "    return take(work, found, stage)\n"
        "lift._take_stage = stage\n"
    )
    command = [
        *MAIN[:-1],
        waiting + MAIN[-1],
        "plan",
        "push",
        "--task-seed",
        "3",
        "--schedule",
        "quasistatic",
    ]
    with subprocess.Popen(
        [*command, "--out", str(plan)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "waits\n"
        process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 130, err
    assert "interrupted; the plan holds on quasistatic-rigid @ 0.001" in out and "Traceback" not in err
    kept = rw.load_plan(plan)
    assert str(kept.replay().outcome) == "goal" and not kept.found


def test_output_that_cannot_be_written() -> None:
    with subprocess.Popen([*MAIN, "models"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 1
    if Path("/dev/full").exists():
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                [*MAIN, "models"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
            )
        refused(Answer(done.returncode, "", done.stderr), "output: cannot be written")


SETS = ("sets", "two_finger", "--model", "quasistatic-rigid", "--over", "v1=0.2:2.2,v2=0.2:2.2")


@pytest.mark.long
def test_sets_answers_and_keeps(rungwise: Command, tmp_path: Path) -> None:
    answer = rungwise(*SETS, "--tol", 0.02, "--certify", 200, "--out", tmp_path, "--threads", 1, "--json")
    assert answer.code == 0
    one = answer.json["sets"][0]
    assert one["model"] == "quasistatic-rigid" and one["complete"] and one["certified"]["samples"] == 200
    assert sum(one["volumes"].values()) == pytest.approx(1.0) and set(one["volumes"]) == {
        "feasible",
        "doomed",
    }
    assert answer.json["over"] == {"v1": [0.2, 2.2], "v2": [0.2, 2.2]} and answer.json["between"] == []
    assert (tmp_path / "sets.png").stat().st_size > 5000
    assert rw.load_set(tmp_path / "quasistatic-rigid").evaluations == one["evaluations"]
    refused(rungwise(*SETS, "--tol", 0.02, "--out", tmp_path), "exists; --force overwrites it, --resume")
    assert (
        rungwise(*SETS, "--tol", 0.02, "--out", tmp_path, "--resume", "--json").json["sets"][0]["hits"] == 0
    )
    assert rungwise(*SETS, "--tol", 0.1, "--out", tmp_path, "--force").code == 0


@pytest.mark.long
def test_sets_as_files(rungwise: Command, tmp_path: Path) -> None:
    files = ("--csv", tmp_path / "a.csv", "--mesh", tmp_path / "b.obj", "--html", tmp_path / "c.html")
    one = rungwise(*SETS, "--tol", 0.05, *files, "--json")
    assert one.json["files"] == [str(tmp_path / name) for name in ("a.csv", "b.obj", "c.html")]
    assert (tmp_path / "a.csv").read_text().startswith("v1,v2,kind,label,beyond,margin\n")
    three = rungwise(
        "sets", "two_finger", "--model", "kinematic", "--solutions", "all", *SETS[4:], "--tol", 0.05, *files,
        "--force",
    )  # fmt: skip
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {"a-kinematic.csv", "a-kinematic-possible.csv", "b-kinematic-guaranteed.obj"}
    assert three.out.count("wrote ") == 7
    assert "kinematic, guaranteed" in (tmp_path / "c.html").read_text()


def test_sets_of_all_rungs_are_compared(rungwise: Command) -> None:
    answer = rungwise("sets", "two_finger", "--model", "all", "--over", "v2=0.3:3", "--tol", 0.05)
    moving = sum(rung.moves for rung in rw.LADDER)
    assert answer.code == 0 and answer.out.count("contradicted their cell") == moving
    assert "dynamic-rigid -> dynamic-compliant: loses" in answer.out


@pytest.mark.long
def test_sets_of_all_motions(rungwise: Command, tmp_path: Path) -> None:
    arguments = ("sets", "two_finger", "--model", "kinematic", "--over", "v2=0.3:3", "--solutions", "all")
    answer = rungwise(*arguments, "--out", tmp_path, "--json")
    found = {each["solutions"]: each["volumes"]["feasible"] for each in answer.json["sets"]}
    assert found == pytest.approx(
        {"slowest": 1.5 / 2.7, "possible": 1.5 / 2.7, "guaranteed": (1.5 - 2.0 / 3.0) / 2.7}, abs=0.01
    )
    assert (tmp_path / "kinematic-guaranteed" / "set.zarr").is_dir()
    assert "kinematic, possible -> kinematic, guaranteed: loses" in rungwise(*arguments).out


def test_sets_without_a_feasible_point_is_negative(rungwise: Command) -> None:
    assert rungwise("sets", "two_finger", "--model", "kinematic", "--over", "v2=0.1:0.3").code == 1


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--over", "v1,v9"), ("unknown parameter 'v9'", "valid: v1")),
        (("--over", "v1=2:1"), ("v1=2:1 must be an interval",)),
        (("--over", "v1=a:b"), ("NAME=LOW:HIGH",)),
        (("--over", "v1,v1"), ("given twice",)),
        (("--over", "x3"), ("x3 needs an interval",)),
        (("--over", "v1", "--tol", "0"), ("tol",)),
        (("--over", "v1", "--solutions", "any"), ("solutions: unknown 'any'; valid: slowest, possible",)),
        (("--over", "v1", "--resume"), ("resume", "--out")),
        (("--over", "v1", "--accuracy", "-1"), ("tol: must be",)),
        (("--over", "v1", "--out", "/dev/null/x"), ("cannot be written",)),
        (("--over", "v1", "--mesh", "x.obj"), ("mesh: needs a set over 2 or 3 parameters, not 1",)),
        (("--over", "v1,v2", "--mesh", "x.ply"), ("mesh: x.ply must end in .obj or .stl",)),
    ],
)
def test_sets_refuses_wrong_input(
    rungwise: Command, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    refused(rungwise("sets", "two_finger", "--model", "kinematic", *arguments), *words)


@pytest.mark.long
def test_doomed_states(rungwise: Command, tmp_path: Path) -> None:
    arguments = (
        "doomed", "two_finger", "--model", "kinematic", "--over", "x1,x2,x3=-1.6:1.6",
        "--inputs", "v1=0.5:1,v2=0.5:1", "--cells", 23, "--set", "offset=0.3",
    )  # fmt: skip
    answer = rungwise(*arguments, "--out", tmp_path, "--json")
    assert answer.code == 0 and answer.json["volumes"]["doomed"] > 0.3
    assert answer.json["rule"]["both"] > 0.4 and answer.json["holds_on"]["dynamic-rigid"] is False
    assert (tmp_path / "doomed.png").stat().st_size > 5000
    for change, words in (
        (("--inputs", "v1"), "v1 needs an interval"),
        (("--over", "x1,x2"), "lacks part.x3"),
        (("--model", "quasistatic-compliant"), "take a rigid rung"),
        (("--stride", "-1"), "strides must lie"),
    ):
        refused(rungwise(*arguments, *change), words)


def test_the_package_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rungwise", "models"], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.startswith("geometric")


WRONG_SCHEDULES = {
    "": "is empty; it must be a list",
    "# nothing": "is empty; it must be a list",
    "3": "inputs: must be a list of segments, not 3",
    "[null]": "inputs.0: must be a mapping of fields",
    "[{duration: 1, foo: 2}]": "inputs.0: unknown field 'foo'",
    "[{duration: .nan}]": "inputs.0.duration: must be finite",
    "[{duration: -1}]": "inputs.0.duration: must be >= 0",
    "[{duration: 1, inputs: {zz: 1}}]": "inputs.0.inputs: unknown input 'zz'; valid: ux, uy",
    "[{duration: 1, inputs: {ux: .nan}}]": "inputs.0.inputs.ux: must be finite",
    "[{duration: 1, inputs: {ux: abc}}]": "inputs.0.inputs.ux: must be a number",
    "[{duration: 1, inputs: [1, 2]}]": "inputs.0.inputs: must be a mapping",
    "[{duration: 1, until: 'zz > 9'}]": "inputs.0.until: unknown name zz",
    "[{duration: 1": "line 1",
}


@pytest.mark.few(3)
@pytest.mark.parametrize("text", WRONG_SCHEDULES)
def test_wrong_schedules_are_one_line(rungwise: Command, tmp_path: Path, text: str) -> None:
    path = tmp_path / "inputs.yaml"
    path.write_text(text)
    refused(rungwise("sim", "push", "--model", "kinematic", "--inputs", path), WRONG_SCHEDULES[text])


def test_schedules_that_are_no_files_are_one_line(rungwise: Command, tmp_path: Path) -> None:
    refused(rungwise("sim", "push", "--model", "kinematic", "--inputs", tmp_path / "none.yaml"), "is no file")
    refused(rungwise("sim", "push", "--model", "kinematic", "--inputs", tmp_path), "is a folder")


def test_plan_is_found_saved_verified_and_drawn(rungwise: Command, tmp_path: Path) -> None:
    plan, table, page = tmp_path / "new" / "plan.json", tmp_path / "plan.csv", tmp_path / "plan.html"
    answer = rungwise(
        "plan", "push", "--task-seed", 3, "--to", "quasistatic-rigid", "--out", plan, "--csv", table, "--json"
    )
    assert answer.code == 0 and answer.json["found"] and answer.json["model"] == "quasistatic-rigid"
    assert table.read_text().startswith("time,label,until,ux,uy\n")
    answer = rungwise("verify", plan, "--samples", 20, "--json")
    assert answer.json["samples"] == 20 and answer.code == (0 if answer.json["lower"] >= 0.9 else 1)
    assert rungwise("verify", plan, "--samples", 20, "--rate", 0).code == 0
    answer = rungwise("view", plan, "--model", "kinematic", "--model", "dynamic-rigid", "--html", page)
    assert answer.code == 0 and page.stat().st_size > 10_000
    drawn = tmp_path / "apart.svg"
    rungs = ("--model", "kinematic", "--model", "quasistatic-rigid")
    answer = rungwise("view", plan, *rungs, "--parting", drawn, "--json")
    assert answer.code == 0 and answer.json["diagnosis"]["after"] == "quasistatic-rigid"
    assert drawn.read_text().count("<path") > 20
    answer = rungwise("plan", "push", "--task-seed", 3, "--to", "geometric", "--out", plan, "--csv", table)
    refused(answer, "out: ", "exists; --force overwrites it")
    geometric = ("plan", "push", "--task-seed", 3, "--to", "geometric", "--out", plan, "--force")
    answer = rungwise(*geometric, "--csv", table)
    refused(answer, "csv: it is of the geometric rung")
    refused(rungwise("view", plan), "plan: it is of the geometric rung: it has places, but no inputs")
    refused(rungwise("verify", plan), "plan: it is of the geometric rung")
    refused(rungwise("view", plan, "--parting", drawn, "--force"), "plan: it is of the geometric rung")
    refused(
        rungwise("view", plan, *rungs, "--parting", drawn, "--force"), "plan: it is of the geometric rung"
    )
    for more in (("--robust", 0.9), ("--improve", 10)):
        answer = rungwise("plan", "push", "--task-seed", 3, "--to", "geometric", *more)
        refused(answer, f"{more[0][2:]}: needs a plan with inputs; on geometric @ 0.01 there are only places")
    schedule = "geometric,kinematic@0.01,quasistatic-rigid@0.01"
    answer = rungwise("plan", "push", "--task-seed", 3, "--schedule", schedule, "--out", plan, "--force")
    assert answer.code == 0 and "without being touched by a robot" in answer.out
    assert rungwise("view", plan, "--parting", drawn, "--force").code == 0
    answer = rungwise("plan", "push", "--task-seed", 3, "--to", "quasistatic-rigid", "--out", plan, "--force")
    again = rungwise("plan", "push", "--task-seed", 3, "--initial", plan, "--schedule", "dynamic-rigid@0.01")
    assert again.code == 0 and "dynamic-rigid @ 0.01" in again.out


def test_version_and_choices(rungwise: Command) -> None:
    assert rungwise("--version").out == f"rungwise {rw.__version__}\n"
    refused(rungwise("sim", "push"), "Missing option '--model'. Valid: kinematic, quasistatic-rigid")
    refused(rungwise("sim", "push", "--model"), "Valid: kinematic, quasistatic-rigid")
    refused(rungwise("check"), "Missing argument", "a YAML file, or blocks, book, card")
    refused(rungwise("sets", "push", "--model", "kinematic"), "Valid: names of parameters")
    refused(rungwise("sim", "push", "--modle", "kinematic"), "--model")
    assert "--install-completion" in rungwise("--help").out


def test_errors_are_json_where_answers_are(rungwise: Command) -> None:
    answer = rungwise("sim", "push", "--model", "zzz", "--json")
    assert answer.code == 2 and json.loads(answer.out)["error"].startswith("model: unknown 'zzz'")


def test_check_tells_units_travel_and_drives(rungwise: Command) -> None:
    text = rungwise("check", "grasp").out
    assert "finger1.x: starts at -0.15, travels freely, driven by a servo: stiffness spring" in text
    assert "part.angle: starts at 0 rad, travels freely\n" in text
    assert (
        "finger1.x1: starts at 0, travels 0 to 2, driven by speed v1" in rungwise("check", "two_finger").out
    )
    assert "  mu           0.6, 0 to 100  friction between fingers and part" in text


def test_a_rate_of_success_names_its_mode(rungwise: Command, tmp_path: Path) -> None:
    plan = tmp_path / "plan.json"
    answer = rungwise(
        "plan", "push", "--task-seed", 3, "--to", "quasistatic-rigid", "--robust", 0.5, "--samples", 12,
        "--out", plan, "--json",
    )  # fmt: skip
    assert answer.code == 0 and answer.json["mode"] in ("open loop", "guarded moves", "re-planning")
    assert answer.json["checks"][-1]["lower"] >= 0.5
    assert rungwise("verify", plan, "--samples", 12, "--json").json["mode"] == answer.json["mode"]
    refused(rungwise("plan", "push", "--robust", 2), "robust: must be between 0 and 1, not 2")
    refused(rungwise("verify", plan, "--mode", "zzz"), "mode: unknown 'zzz'", "guarded moves")


def test_no_plan_is_exit_code_1(rungwise: Command) -> None:
    answer = rungwise("plan", "push", "--task-seed", 3, "--budget", 300)
    assert answer.code == 1 and "no plan" in answer.out and "the budget is spent" in answer.out


def test_a_search_without_a_plan_leaves_no_file_that_blocks_the_next(
    rungwise: Command, tmp_path: Path
) -> None:
    file = tmp_path / "plan.json"
    search = ("plan", "push", "--task-seed", 3, "--to", "quasistatic-rigid", "--out", file)
    answer = rungwise(*search, "--budget", 300)
    assert answer.code == 1 and "plan.json was not written, because there is no plan" in answer.err
    assert not file.exists()
    assert rungwise(*search).code == 0 and rw.load_plan(file).found


@pytest.mark.long
def test_resume_refuses_a_folder_of_other_things(rungwise: Command, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("kept")
    fit = ("fit", "push", "--model", "kinematic", "--data", tmp_path / "notes.txt", "--over", "mu")
    for command in (SETS, (*SETS[:3], "all", *SETS[4:]), fit):
        refused(rungwise(*command, "--out", tmp_path, "--resume"), "resume: ", "holds nothing to go on from")
    with pytest.raises(rw.SetError, match="holds no set to go on from"):
        rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), out=tmp_path, resume=True)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    empty = tmp_path / "empty"
    empty.mkdir()
    assert rungwise(*SETS, "--tol", 0.1, "--out", empty, "--resume").code == 0


def test_plans_that_cannot_be(rungwise: Command, tmp_path: Path) -> None:
    refused(rungwise("plan", "pivot"), "task: the scene has none")
    refused(rungwise("plan", "push", "--to", "zzz"), "unknown 'zzz'", "dynamic-compliant")
    refused(rungwise("plan", "push", "--schedule", "zzz"), "schedule: unknown 'zzz'", "coarse-fine")
    refused(rungwise("plan", "push", "--schedule", "kinematic@x"), "an accuracy must be a number")
    refused(
        rungwise("plan", "push", "--set", "post1_x=0", "--set", "post1_y=0"), "start: box and post1 overlap"
    )
    refused(rungwise("plan", "push", "--out", tmp_path), "is a folder")
    refused(rungwise("plan", "push", "--initial", tmp_path / "no.json"), "is no file")
    wrong = tmp_path / "wrong.json"
    wrong.write_text("{}")
    for command in (("verify", wrong), ("view", wrong), ("plan", "push", "--initial", wrong)):
        refused(rungwise(*command), "holds no saved plan")
    refused(rungwise("verify", tmp_path / "no.json"), "is no file")
    apart = ("--parting", tmp_path / "apart.png")
    refused(rungwise("view", "push", *apart), "parting: needs one saved plan (JSON)")
    refused(rungwise("view", wrong, *apart, "--png", "x.png"), "--parting is a picture of its own")


def test_exit_codes_of_outcomes_are_those_of_the_page() -> None:
    page = Path(__file__).parents[1] / "docs" / "outcomes.md"
    rows = [line.split("|") for line in page.read_text("utf-8").splitlines() if line.startswith("| `")]
    told = {row[1].strip(" `"): int(row[-2].split(";")[0]) for row in rows}
    assert told == {str(outcome): outcome.exit_code for outcome in rw.Outcome}


def test_a_run_that_a_limit_ends_is_told_and_its_answer_is_open(rungwise: Command, tmp_path: Path) -> None:
    found = rungwise(*SIM, "--limit", 0, "--json", "--out", tmp_path)
    assert found.code == rw.Outcome.RUNNING.exit_code == 1
    assert found.json["outcome"] == "running" and "0 s are over" in found.json["reason"]
    assert rw.load_run(tmp_path).outcome == "running"


QUICK = {"models", "scenes", "check"}
"""Commands that never take long."""
WORK = {
    "sets": "two_finger --model kinematic --over v1,v2",
    "doomed": "two_finger --model kinematic --over x1,x2,x3=-1.6:1.6 --inputs v1=0.5:1,v2=0.5:1",
    "plan": "push --task-seed 4",
    "design": "two_finger --over v2",
    "compare": "two_finger",
    "replay": "ball",
    "view": "two_finger --html {out}/page.html",
    "sim": "two_finger --model kinematic",
}


def test_each_command_that_can_take_long_has_one_limit() -> None:
    helps = dict[str, str]()
    for each in cli.app.registered_commands:
        assert each.callback is not None
        hints = get_type_hints(each.callback, include_extras=True)
        if "limit" in hints:
            helps[each.callback.__name__] = hints["limit"].__metadata__[0].help
        else:
            assert each.callback.__name__ in QUICK
    assert helps.keys() >= WORK.keys() and len(set(helps.values())) == 1


@pytest.mark.few(3)
@pytest.mark.parametrize("name", WORK)
def test_a_command_without_time_says_so(name: str, rungwise: Command, tmp_path: Path) -> None:
    """In one line where there is nothing to tell; none has a positive answer but pictures."""
    found = rungwise(name, *WORK[name].format(out=tmp_path).split(), "--limit", 0)
    if found.code == 2:
        refused(found, "limit: ", "over")
    else:
        assert found.code == (0 if name == "view" else 1)
        assert "running" in found.out or "time is over" in found.out or "time was over" in found.out


def completed(words: str) -> list[str]:
    """What a shell offers for the last word."""
    last = str(len(words.split(" ")) - 1)
    shell = {"_RUNGWISE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": last}
    named = [*MAIN[:-1], f"import sys; sys.argv = ['rungwise']; {MAIN[-1]}"]
    told = subprocess.run(named, capture_output=True, text=True, env=os.environ | shell)
    return told.stdout.split()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("rungwise sim two_f", ["two_finger", "two_finger_free", "two_finger_servo"]),
        ("rungwise check sta", ["stack"]),
        ("rungwise sim push --model quasi", ["quasistatic-rigid", "quasistatic-compliant"]),
        ("rungwise sim two_finger --model kinematic --set mu=0.1 --set sti", ["stiffness"]),
        ("rungwise view two_finger --set sti", ["stiffness"]),
        ("rungwise sim --set sti", []),
        ("rungwise sets two_finger --model kinematic --over v1,v", ["v1,v1", "v1,v2"]),
        ("rungwise sim no_such_scene --set s", []),
    ],
)
def test_shells_complete_scenes_rungs_and_parameters(words: str, offered: list[str]) -> None:
    assert completed(words) == offered


@pytest.mark.long
def test_shells_complete_parameters_of_the_scene_that_is_named_before() -> None:
    assert completed("rungwise sim two_finger --model kinematic --set sti") == ["stiffness"]


def test_every_scene_and_rung_can_be_completed() -> None:
    for name, command in typer.main.get_command(cli.app).commands.items():  # type: ignore[attr-defined]
        for each in command.params:
            if each.name in ("scene", "model", "from_", "to", "values"):
                assert getattr(each, "_custom_shell_complete", None) is not None, (name, each.name)
