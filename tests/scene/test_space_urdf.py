"""URDF files of all kinds of joints: `check` and `sim` take them, or say why not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rungwise import cli

SOLID = (
    '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><geometry><box size=".1 .1 .4"/></geometry></collision>'
)
LIMIT = '<limit lower="-.5" upper=".5" effort="10" velocity="1"/><dynamics damping="2" friction=".3"/>'


def _robot(folder: Path, *joints: str, links: int = 1) -> Path:
    parts = "".join(f'<link name="l{k}">{SOLID}</link>' for k in range(1, links + 1))
    path = folder / "r.urdf"
    path.write_text(f'<robot name="r"><link name="l0"/>{parts}{"".join(joints)}</robot>')
    return path


def _joint(name: str, kind: str, child: int, inside: str = "", parent: int = 0) -> str:
    ends = f'<parent link="l{parent}"/><child link="l{child}"/><origin xyz="{child} 0 0"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="0 0 1"/>{inside}</joint>'


def _ran(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> tuple[int, str]:
    monkeypatch.setattr("sys.argv", ["rungwise", *words])
    with pytest.raises(SystemExit) as end:
        cli.main()
    told = capsys.readouterr()
    assert isinstance(end.value.code, int)
    return end.value.code, (told.out or told.err).strip()


KINDS = {
    "continuous": ({"l1.j": "hinge"}, None),
    "revolute": ({"l1.j": "hinge"}, (-0.5, 0.5)),
    "prismatic": ({"l1.j": "slide"}, (-0.5, 0.5)),
    "floating": ({"l1.x": "free"}, None),
    "planar": ({"l1.j_TX": "slide", "l1.j_TY": "slide", "l1.j_RZ": "hinge"}, None),
}


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", KINDS)
def test_a_joint_of_each_kind_is_listed_and_runs(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    coordinates, limits = KINDS[kind]
    path = _robot(tmp_path, _joint("j", kind, 1, LIMIT if limits else ""))
    code, said = _ran(capsys, monkeypatch, "check", str(path), "--json")
    assert code == 0
    found = json.loads(said)["bodies"]["l1"]["coordinates"]
    assert {name: each["joint"] for name, each in found.items()} == coordinates
    if limits:
        (own,) = found.values()
        assert (own["lower"], own["upper"], own["damping"], own["dry_friction"]) == (*limits, 2.0, 0.3)
    code, said = _ran(capsys, monkeypatch, "sim", str(path), "--model", "dynamic-rigid", "--time", "0.02")
    assert code == 1 and "timeout" in said


def test_a_robot_of_fixed_joints_alone_can_be_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(_robot(tmp_path, _joint("j", "fixed", 1)))
    code, said = _ran(capsys, monkeypatch, "check", path)
    assert code == 0 and "world" in said
    for model in ("kinematic", "quasistatic-compliant", "dynamic-rigid"):
        code, said = _ran(capsys, monkeypatch, "sim", path, "--model", model, "--time", "0.02")
        assert code == 1 and "timeout" in said and "nothing can move in it" in said
    page = tmp_path / "still.html"
    code, _ = _ran(capsys, monkeypatch, "view", path, "--model", "kinematic", "--html", str(page))
    assert code == 0 and page.stat().st_size > 10_000


@pytest.mark.parametrize(("offset", "ratio"), [(0.0, 1.0), (0.0, -2.0), (0.2, 1.0)])
def test_a_joint_that_mimics_another_is_an_equality(
    tmp_path: Path, offset: float, ratio: float,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    mimic = f'<mimic joint="a" multiplier="{ratio}" offset="{offset}"/>'
    path = _robot(
        tmp_path, _joint("a", "prismatic", 1, LIMIT), _joint("b", "prismatic", 2, LIMIT + mimic), links=2
    )
    code, said = _ran(capsys, monkeypatch, "check", str(path))
    if offset:
        assert code == 2
        assert "start: equality number 0 (joint of l2.b and l1.a) is open by 0.2; start.places" in said
    else:
        assert code == 0 and "  number 0             joint of l2.b and l1.a" in said.splitlines()


def test_equalities_and_tendons_of_all_kinds_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bodies = "".join(
        f'<body name="{name}" pos="{k} 0 1"><joint name="{name}j" type="slide"/><geom size=".1"/>'
        f'<site name="{name}s" pos="{-k} 0 0"/></body>'
        for k, name in enumerate("ab")
    )
    path = tmp_path / "m.xml"
    path.write_text(
        f"""<mujoco><worldbody>{bodies}<body name="c" pos="5 0 1"><freejoint/><geom size=".1"/></body>
        </worldbody><tendon><fixed name="t" limited="true" range="-.5 .5" stiffness="3" damping="2">
        <joint joint="aj" coef="1"/><joint joint="bj" coef="-1"/></fixed>
        <spatial><site site="as"/><site site="bs"/></spatial></tendon>
        <equality><joint name="e" joint1="aj" joint2="bj"/><joint joint1="aj"/><weld body1="c"/>
        <connect site1="as" site2="bs" active="false"/><tendon tendon1="t"/></equality></mujoco>"""
    )
    code, said = _ran(capsys, monkeypatch, "check", str(path), "--json")
    assert code == 0
    report = json.loads(said)
    assert [(n, e["kind"], e["between"], e["active"]) for n, e in report["equalities"].items()] == [
        ("e", "joint", ["a.aj", "b.bj"], True), ("number 1", "joint", ["a.aj"], True),
        ("number 2", "weld", ["c", "world"], True), ("number 3", "connect", ["as", "bs"], False),
        ("number 4", "tendon", ["t"], True),
    ]  # fmt: skip
    t = report["tendons"]["t"]
    assert (t["lower"], t["upper"], t["stiffness"], t["damping"]) == (-0.5, 0.5, 3.0, 2.0)
    assert list(report["tendons"]) == ["t", "number 1"]
    _, said = _ran(capsys, monkeypatch, "check", str(path))
    assert "travels -0.5 to 0.5, stiffness 3, damping 2" in said
    assert "number 3             connect of as and bs, inactive" in said
    code, said = _ran(capsys, monkeypatch, "replay", str(path), "--model", "dynamic-rigid", "--time", "0.01")
    assert "outcome in mujoco: timeout" in said
