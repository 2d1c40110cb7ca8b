"""Files of pictures: what they hold, how large they are, and what is refused."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rungwise as rw
from rungwise.cli import app
from rungwise.viewing.plane import pictures
from rungwise.viewing.plane.clip import Clip, clip
from rungwise.viewing.plane.run_page import page

RUNGS = ("quasistatic-rigid", "dynamic-rigid", "dynamic-compliant")


@pytest.fixture(scope="module")
def runs() -> list[rw.Run]:
    return [rw.simulate("two_finger", name, parameters={"v2": 0.7}) for name in RUNGS]


def data_of(text: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return dict(json.loads(found.group(1)))


def unpacked(packed: dict[str, Any]) -> np.ndarray[Any, Any]:
    columns = len(packed["low"])
    integers = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(-1, columns)
    return np.array(packed["low"]) + np.array(packed["step"]) * integers


def test_page_holds_poses_forces_and_curves(runs: list[rw.Run]) -> None:
    clips = [clip(run) for run in runs]
    data = data_of(page(clips))
    assert [c["label"] for c in data["clips"]] == list(RUNGS)
    for made, packed in zip(clips, data["clips"], strict=True):
        assert [body["moves"] for body in packed["bodies"]] == [True, True, True, False]
        flat = made.pose.reshape(len(made.time), -1)
        span = np.ptp(flat, axis=0)
        assert (abs(unpacked(packed["pose"]) - flat) <= 0.51 / 65535.0 * span + 1e-15).all()
        time = np.frombuffer(base64.b64decode(packed["time"]), "<f4")
        assert time == pytest.approx(made.time, rel=1e-6)
        first = np.frombuffer(base64.b64decode(packed["first"]), "<u4")
        assert len(first) == len(time) + 1 and first[-1] == len(made.touches.frame)


def test_page_names_no_address(runs: list[rw.Run]) -> None:
    text = page([clip(run) for run in runs])
    assert "http" not in text.replace("http-equiv", "") and "default-src 'none'" in text
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|import)\b", text)


def test_names_of_a_scene_cannot_leave_the_data(runs: list[rw.Run]) -> None:
    hostile = Clip(
        **{**clip(runs[0]).__dict__, "reason": "</script><script>alert(1)</script>", "scene": "<b>"}
    )
    text = page([hostile])
    assert text.count("</script>") == 2 and "<b>" not in text
    assert data_of(text)["clips"][0]["reason"] == hostile.reason


def many(frames: int, touches: int, bodies: int) -> Clip:
    """A long run of many bodies that touch in many points."""
    rng = np.random.default_rng(0)
    base = clip(rw.simulate("blocks", "dynamic-compliant", frames=3))
    rows = frames * touches
    t = base.touches
    touching = type(t)(
        np.repeat(np.arange(frames), touches), np.zeros(rows, int), rng.normal(size=(rows, 2)),
        rng.normal(size=(rows, 2)), np.ones(rows, int),
    )  # fmt: skip
    changed: dict[str, Any] = {
        "time": np.arange(frames) * 1e-3,
        "pose": rng.normal(size=(frames, bodies, 3)),
        "bodies": tuple(f"body{k}" for k in range(bodies)),
        "roles": ("object",) * bodies,
        "moving": np.ones(bodies, bool),
        "contacts": ("body0 | body1",),
        "gap": rng.normal(size=(frames, 1)),
        "push": rng.normal(size=(frames, 1)),
        "touches": touching,
        "raised": np.zeros((frames, bodies)),
    }
    return Clip(**{**base.__dict__, **changed})


@pytest.mark.few(1)
@pytest.mark.parametrize(("touches", "thinned"), [(40, False), (600, True)])
def test_file_of_a_long_run_stays_below_five_megabytes(touches: int, thinned: bool) -> None:
    made = many(2000, touches, 60)
    text = page([made])
    assert len(text.encode()) < 5_000_000
    time = np.frombuffer(base64.b64decode(data_of(text)["clips"][0]["time"]), "<f4")
    assert (len(time) < 2000) == thinned
    assert time[0] == 0.0 and time[-1] == np.float32(made.time[-1])


@pytest.mark.long
def test_view_writes_all_three_kinds(
    tmp_path: Path, runs: list[rw.Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    from PIL import Image

    monkeypatch.setattr(pictures.save_gif, "__defaults__", (10, 5.0))

    files = rw.view(
        runs[:2],
        html=tmp_path / "a" / "run.html",
        png=tmp_path / "run.png",
        gif=tmp_path / "run.gif",
        frames=4,
    )
    assert [file.suffix for file in files] == [".html", ".png", ".gif"]
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == ["run.gif", "run.html", "run.png"]
    with Image.open(tmp_path / "run.gif") as picture:
        assert picture.n_frames == 10
    with Image.open(tmp_path / "run.png") as picture:
        pixels = np.asarray(picture.convert("RGB"), int)
    for colour in ((0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00), (0xD5, 0xE3, 0xF2)):  # both models, the part
        assert (abs(pixels - colour).sum(axis=2) < 12).sum() > 100


def test_view_refuses_in_one_line(tmp_path: Path, runs: list[rw.Run]) -> None:
    other = rw.simulate("slide_roll", "kinematic")
    with pytest.raises(rw.ViewError, match="do not have the same bodies"):
        rw.view([runs[0], other], html=tmp_path / "x.html")
    with pytest.raises(rw.ViewError, match="at least one"):
        rw.view([])
    with pytest.raises(rw.ViewError, match="frames"):
        rw.view(runs[0], png=tmp_path / "x.png", frames=0)
    for at in (float("nan"), float("inf"), -1.0):
        with pytest.raises(rw.ViewError, match="at: must be a finite time, at least 0"):
            rw.view(runs[0], png=tmp_path / "x.png", at=at)
    with pytest.raises(rw.ViewError, match=r"run\.json"):
        rw.view(tmp_path, html=tmp_path / "x.html")
    (tmp_path / "file").touch()
    with pytest.raises(rw.ViewError, match="cannot be written"):
        rw.view(runs[0], html=tmp_path / "file" / "x.html")
    assert not list(tmp_path.glob(".*"))


def test_view_takes_a_plan_and_refuses_what_is_none(tmp_path: Path) -> None:
    plan = rw.plan("two_finger", seed=0)
    assert rw.view(plan, html=tmp_path / "plan.html")[0].stat().st_size > 10_000
    plan.save(tmp_path / "plan.json")
    again = rw.view(tmp_path / "plan.json", html=tmp_path / "again.html")[0].read_text("utf-8")
    assert data_of(again) == data_of((tmp_path / "plan.html").read_text("utf-8"))
    with pytest.raises(rw.ViewError, match="there is none"):
        rw.view(dataclasses.replace(plan, stage=None, reason="out of steps"))
    for wrong in (3, None, [plan, 3]):
        with pytest.raises(rw.ViewError, match=r"^runs: must be runs, plans, sets"):
            rw.view(wrong)  # type: ignore[arg-type]


def test_a_folder_of_results_is_pointed_into(tmp_path: Path, runs: list[rw.Run]) -> None:
    for run in runs[:2]:
        run.save(tmp_path / "out" / run.model.name)
    (tmp_path / "out" / "else").mkdir()
    done = CliRunner().invoke(app, ["view", str(tmp_path / "out")])
    assert done.exit_code == 2 and done.output.count("\n") == 1
    assert done.output.endswith(", ".join(str(tmp_path / "out" / name) for name in sorted(RUNGS[:2])) + "\n")


def test_command_draws_saved_runs_over_each_other(tmp_path: Path, runs: list[rw.Run]) -> None:
    for name, run in zip(RUNGS[:2], runs[:2], strict=True):
        run.save(tmp_path / name)
    target = tmp_path / "both.html"
    folders = [str(tmp_path / name) for name in RUNGS[:2]]
    done = CliRunner().invoke(app, ["view", *folders, "--html", str(target), "--json"])
    assert done.exit_code == 0 and json.loads(done.output)["files"] == [str(target)]
    assert len(data_of(target.read_text("utf-8"))["clips"]) == 2


def test_command_runs_a_scene_on_the_rungs_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = ["--model", "kinematic", "--model", "quasistatic-rigid", "--set", "v2=0.9", "--json"]
    done = CliRunner().invoke(app, ["view", "two_finger", *options])
    assert json.loads(done.output) == {
        "files": ["two_finger.html"],
        "runs": [
            {"model": "kinematic", "outcome": "goal"},
            {"model": "quasistatic-rigid", "outcome": "goal"},
        ],
    }
    assert data_of(Path("two_finger.html").read_text("utf-8"))["clips"][0]["label"] == "kinematic"


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere"], "no scene that ships"),
        (["two_finger", "--model", "quasi"], "quasi"),
        (["two_finger", "--model", "geometric"], "geometric"),
        (["two_finger", "slide_roll"], "is no folder"),
        (["{folder}", "--model", "kinematic"], "one scene with --model"),
        (["{folder}"], "holds no saved run"),
        (["two_finger", "--set", "v2=fast"], "v2=fast"),
        (["two_finger", "--model", "kinematic", "--frames", "0", "--png", "{folder}/x.png"], "frames"),
    ],
)
def test_command_refuses_in_one_line(tmp_path: Path, arguments: list[str], says: str) -> None:
    done = CliRunner().invoke(app, ["view", *(text.format(folder=tmp_path) for text in arguments)])
    assert done.exit_code == 2 and says in done.output and done.output.count("\n") == 1
