"""The claims of the paper's Figure 4, in short runs: see docs/figure4.md."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import pytest

import rungwise as rw

pytestmark = pytest.mark.pages

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture
def figure4(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import figure4

    return figure4


COARSE = (0.3, 0.45, 0.6, 0.8, 1.0)


def lower_end(figure4: ModuleType, panel: object, bisections: int = 8) -> float:
    """Where the one set of ratios begins that is caught; by default to 1e-3."""
    ((low, high),) = figure4.caught(panel, COARSE, bisections)
    assert high == 1.0
    return float(low)


def test_quasistatic_panel_is_the_slowest_motion(figure4: ModuleType) -> None:
    assert lower_end(figure4, figure4.A, 12) == pytest.approx(0.5, abs=2e-4)


@pytest.mark.few(1)
@pytest.mark.parametrize("speed", [10.0, 0.1])
def test_damped_panel_is_like_the_quasistatic_one_at_any_speed(figure4: ModuleType, speed: float) -> None:
    assert lower_end(figure4, figure4.B.varied(speed)) == pytest.approx(0.504, abs=2e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("speed", [10.0, 0.1])
def test_undamped_panel_is_narrower_at_any_speed(figure4: ModuleType, speed: float) -> None:
    """4/7 is the limit of elastic impacts; steps of 1e-4 damp a little, and impacts take a little time."""
    end = lower_end(figure4, figure4.C.varied(speed))
    assert end == pytest.approx(4.0 / 7.0, abs=5e-3)
    assert end > 0.56 and figure4.is_caught(figure4.B, rw.load("two_finger"), 0.51)


def test_fingers_that_give_way_undo_the_undamped_impact(figure4: ModuleType) -> None:
    """A finger that follows its speed with a low gain is slowed by the impact, and its drive dissipates."""
    scene = rw.load("two_finger_servo")
    stiff, soft = (figure4.C.with_servos(gain) for gain in (1e6, 10.0))
    at_elastic = [figure4.is_caught(stiff, scene, 4.0 / 7.0 + off) for off in (-0.01, 0.01)]
    assert at_elastic == [False, True]
    assert all(figure4.is_caught(soft, scene, ratio) for ratio in (0.46, 4.0 / 7.0 - 0.01, 0.8))


@pytest.mark.few(3)
@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("changes", [{}, {"mu": 0.9}, {"align": 0.0}, {"finger_mass": 0.1}], ids=str)
def test_free_fingers_with_dissipation_catch_more(
    figure4: ModuleType, speed: float, changes: dict[str, float]
) -> None:
    scene = rw.load("two_finger_free")
    for panel in (figure4.D, figure4.D.on(rw.DYNAMIC_RIGID)):
        varied = panel.varied(speed, **changes)
        assert all(figure4.is_caught(varied, scene, r) for r in (0.3, 0.45, 0.7, 1.0, 1.0 / 0.45, 1.0 / 0.3))


def test_free_fingers_without_dissipation_do_not(figure4: ModuleType) -> None:
    scene = rw.load("two_finger_free")
    for panel in (figure4.D.varied(damping=0.0), figure4.D.on(rw.DYNAMIC_RIGID, restitution=1.0)):
        assert not any(figure4.is_caught(panel, scene, r) for r in (0.3, 0.5, 0.6, 0.8))


@pytest.mark.few(3)
@pytest.mark.parametrize("mass", [0.5, 1.0, 10.0])
@pytest.mark.parametrize("mu", [0.0, 0.5, 0.8])
def test_free_fingers_without_potential_against_the_closed_form(
    figure4: ModuleType, mass: float, mu: float
) -> None:
    """A plastic impact leaves the first finger and the part with a share of the finger's speed."""
    share = (1.0 - mu) * mass / ((1.0 - mu) * mass + (1.0 + mu))
    exact = 1.0 / (1.5 + 0.5 / share)
    panel = figure4.D.on(rw.DYNAMIC_RIGID, well=0.0, align=0.0, finger_mass=mass, mu=mu)
    scene = rw.load("two_finger_free")
    assert not figure4.is_caught(panel, scene, exact - 3e-4)
    assert figure4.is_caught(panel, scene, exact + 3e-4)


def test_potential_has_its_least_on_the_closure_edge() -> None:
    """Damped fingers that touch nothing settle where they would touch both faces, whatever the triangle."""
    shape = {"half_base": 1.5, "height": 0.8, "offset": 0.6, "travel": 3.0}
    slope = shape["height"] / shape["half_base"]
    middle = shape["travel"] - shape["height"] + slope * shape["offset"]
    data = rw.load("two_finger_free").file.model_dump(mode="json", exclude_unset=True)
    data |= {"contacts": [], "goal": None, "doomed": None}
    for finger, name in (("finger1", "x1"), ("finger2", "x2")):
        data["bodies"][finger]["coordinates"][name] |= {"damping": 2.0}
    for x3 in (-0.3, 0.0, 0.25):
        given = {**shape, "x3": x3}
        run = rw.simulate(data, "dynamic-rigid", parameters=given, duration=120.0, step=1e-2)
        assert run.final["finger1"]["x1"] == pytest.approx(middle + slope * x3, abs=1e-6)
        assert run.final["finger2"]["x2"] == pytest.approx(middle - slope * x3, abs=1e-6)


@pytest.mark.few(2)
@pytest.mark.parametrize("ratio", [0.55, 0.06, 0.26, 0.49, 0.29, 0.8])
def test_ratios_and_their_inverses_get_the_same_verdict(figure4: ModuleType, ratio: float) -> None:
    for panel in (*figure4.PANELS, figure4.D.varied(3.0, damping=1e3)):
        scene = rw.load(panel.scene)
        caught = [figure4.is_caught(panel, scene, r) for r in (ratio, 1.0 / ratio)]
        assert caught[0] == caught[1], panel


@pytest.mark.few(2)
@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.45, 1.0 / 0.3])
def test_lost_runs_go_on_to_the_palm_or_jam_at_the_apex(figure4: ModuleType, ratio: float) -> None:
    """As the paper prints them, (2, 2, 3/2) and its mirror image, or at the end of the goal edge."""
    scene = rw.load("two_finger")
    side = 1.0 if ratio < 1.0 else -1.0
    for slowest, outcome, at in ((False, "missed", (2.0, 2.0, 1.5)), (True, "jammed", (2.0, 1.0, 0.5))):
        run = figure4.A.beyond(scene, ratio, slowest)
        x1, x2, x3 = at if ratio < 1.0 else (at[1], at[0], at[2])
        assert run.outcome == outcome
        last = run.trajectory["position"].to_numpy()[-1]
        assert last == pytest.approx([x1, x2, side * x3], abs=1e-9)


def test_guaranteed_band(figure4: ModuleType) -> None:
    assert figure4.guaranteed() == pytest.approx(2.0 / 3.0, abs=1e-9)


def test_command_prints_and_draws(
    figure4: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    lines = (figure4.A, figure4.D)
    monkeypatch.setattr(figure4, "PANELS", lines)
    assert figure4.main(["--json"], lines, (0.3, 0.8, 1.0), 2) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [line["panel"] for line in printed["lines"]] == ["a", "d"]
    monkeypatch.setattr(figure4, "FAN", (0.3,))
    assert figure4.main(["--out", str(tmp_path)], lines, (0.3, 0.8, 1.0), 2) == 0
    assert "0.6667 to 1" in capsys.readouterr().out
    assert (tmp_path / "figure4.png").stat().st_size > 50_000
