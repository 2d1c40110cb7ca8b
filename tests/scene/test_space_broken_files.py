"""Model files that are broken, or name what is not there: one line with the parser's message, exit code 2."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import rungwise as rw
from rungwise import cli
from rungwise.scene import SceneError

MJCF = """<mujoco><option timestep="0.01"/><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
<worldbody><geom name="floor" type="plane" size="1 1 .1"/><body name="b" pos="0 0 1" quat="1 0 0 0">
<freejoint name="f"/><geom name="g" type="mesh" mesh="m"/></body><body name="p" pos="3 0 1"><joint name="j"
type="slide" range="-1 1"/><geom size=".1" condim="4"/></body></worldbody>
<actuator><position name="a" joint="j" kp="5"/></actuator>
<equality><joint joint1="j" polycoef="0 0 0 0 0"/></equality></mujoco>"""
INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""<?xml version="1.0"?><robot name="r"><link name="base"/><link name="arm">{INERTIA}
<collision><geometry><box size=".1 .1 .4"/></geometry></collision></link><joint name="spin" type="revolute">
<parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="5" velocity="1"/></joint></robot>"""
FILES = {"m.xml": MJCF, "m.urdf": URDF}
EACH = 60
"""So many broken files of each kind of damage."""


def _cut(text: bytes, rng: random.Random) -> bytes:
    return text[: rng.randrange(len(text))]


def _flip(text: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(text))
    return text[:at] + bytes([rng.randrange(256)]) + text[at + 1 :]


def _drop(text: bytes, rng: random.Random) -> bytes:
    """Without what stands between two marks of the markup."""
    marks = [i for i, each in enumerate(text) if each in b'<>" =/']
    first, last = sorted(rng.sample(marks, 2))
    return text[:first] + text[min(last, first + 30) :]


def _other_number(text: bytes, rng: random.Random) -> bytes:
    digits = [i for i, each in enumerate(text) if chr(each).isdigit()]
    at = rng.choice(digits)
    return text[:at] + rng.choice([b"nan", b"inf", b"-1", b"1e300", b"x", b""]) + text[at + 1 :]


def _noise(text: bytes, rng: random.Random) -> bytes:
    return rng.randbytes(len(text) // 4)


DAMAGE: list[Callable[[bytes, random.Random], bytes]] = [_cut, _flip, _drop, _other_number, _noise]


def _broken(name: str, damage: Callable[[bytes, random.Random], bytes]) -> Iterator[bytes]:
    rng = random.Random(f"{name} {damage.__name__}")
    for _ in range(EACH):
        yield damage(FILES[name].encode(), rng)


@pytest.mark.few(3)
@pytest.mark.parametrize("damage", DAMAGE, ids=lambda each: each.__name__)
@pytest.mark.parametrize("name", FILES)
@pytest.mark.filterwarnings("ignore")
def test_a_damaged_file_is_read_or_refused_in_one_line(
    tmp_path: Path,
    name: str,
    damage: Callable[[bytes, random.Random], bytes],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo keeps a log of warnings where it runs
    path, refused = tmp_path / name, 0
    for content in _broken(name, damage):
        path.write_bytes(content)
        try:
            run = rw.simulate(path, rw.DYNAMIC_RIGID, duration=0.002)
        except SceneError as error:
            refused += 1
            assert str(error).startswith("model: ") and "\n" not in str(error), content
            assert len(str(error)) < 500
        else:
            assert run.outcome.name != "invalid" or run.reason.startswith("start: "), run.reason
    assert refused > EACH // 10


MISSING = {
    "include.xml": '<mujoco><include file="gone.xml"/><worldbody><body><freejoint/><geom size="1"/></body>'
    "</worldbody></mujoco>",
    "mesh.xml": '<mujoco><asset><mesh name="m" file="gone.stl"/></asset><worldbody><body><freejoint/>'
    '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>',
    "field.xml": '<mujoco><asset><hfield name="h" file="gone.png" size="1 1 1 1"/></asset><worldbody>'
    '<geom type="hfield" hfield="h"/><body><freejoint/><geom size="1"/></body></worldbody></mujoco>',
    "mesh.urdf": URDF.replace('<box size=".1 .1 .4"/>', '<mesh filename="package://gone/gone.stl"/>'),
    "model.yaml": "name: a\nmodel: {file: gone.xml}\n",
    "folder.yaml": "name: a\nmodel: {file: .}\n",
    "package.yaml": "name: a\nmodel: {file: 'gone_package:a.xml'}\n",
}


@pytest.mark.few(2)
@pytest.mark.parametrize("name", MISSING)
def test_what_a_file_names_and_is_not_there_is_named_in_one_line(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_text(MISSING[name])
    for words in (["check", str(path)], ["sim", str(path), "--model", "kinematic"], ["replay", str(path)]):
        monkeypatch.setattr("sys.argv", ["rungwise", *words])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr().err.strip()
        assert end.value.code == 2 and "\n" not in said and "Traceback" not in said
        assert ("a folder" if name == "folder.yaml" else "gone") in said


def test_a_folder_is_no_model(tmp_path: Path) -> None:
    (tmp_path / "m.xml").mkdir()
    with pytest.raises(SceneError, match=r"m\.xml' is a folder, not a model file$"):
        rw.load(tmp_path / "m.xml")


def test_a_name_that_ships_nowhere_lists_scenes_of_both_kinds() -> None:
    with pytest.raises(SceneError, match="did you mean stack"):
        rw.load("stak")
