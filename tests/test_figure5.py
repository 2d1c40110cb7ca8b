"""The claims of the paper's Figure 5: see docs/figure5.md."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import rungwise as rw
from tests.pages import ROOT, same

pytestmark = pytest.mark.pages

FRICTION = np.array([0.0, 0.3, 0.6, 0.8, 0.9])


@pytest.fixture
def figure5(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import figure5

    return figure5


def case(figure5: ModuleType, name: str) -> object:
    (found,) = (case for case in figure5.CASES if case.name == name)
    return found


@pytest.mark.parametrize(("name", "slack"), [("free", 2e-4), ("soft servos", 1e-3)])
def test_friction_widens_the_set_of_fingers_that_yield(figure5: ModuleType, name: str, slack: float) -> None:
    """Gradually, and as in closed form; damped compliant impacts are nearly plastic."""
    chosen = case(figure5, name)
    for v1 in (0.3, 1.0, 2.0):
        found = figure5.least_ratios(chosen, FRICTION, v1)
        exact = [chosen.closed_form(mu, v1) for mu in FRICTION]  # type: ignore[attr-defined]
        assert found == pytest.approx(exact, abs=slack)
        assert (np.diff(found) < 0.0).all() and found[0] < 0.5


def test_the_limits_of_soft_servos(figure5: ModuleType) -> None:
    """Without gain they are free, and of infinite gain prescribed."""
    for mu in FRICTION:
        assert figure5.soft_servos(mu, gain=1e-6) == pytest.approx(figure5.free(mu), abs=1e-6)
        assert figure5.soft_servos(mu, gain=1e7) == pytest.approx(0.5, abs=1e-5)


def test_a_potential_widens_it_more(figure5: ModuleType) -> None:
    pulled = figure5.least_ratios(case(figure5, "free, pulled"), FRICTION)
    assert (np.diff(pulled) < 0.0).all() and (pulled < [figure5.free(mu) for mu in FRICTION]).all()


def test_friction_opens_the_quadrant_to_force_limited_fingers_at_once(figure5: ModuleType) -> None:
    found = figure5.least_ratios(case(figure5, "force-limited"), np.array([0.0, 0.5, 0.99, 1.01, 1.5]))
    assert found == pytest.approx([0.5, 0.5, 0.5, 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("height", [0.8, 1.25])
def test_the_threshold_is_the_slope_of_the_faces(height: float) -> None:
    for mu, ends in ((height - 0.02, "doomed"), (height + 0.02, "goal")):
        given = {"height": height, "mu": mu, "v2": 0.15}
        assert rw.simulate("two_finger_servo", "quasistatic-rigid", parameters=given).outcome == ends


@pytest.mark.parametrize("mass", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("least", [0.05, 0.2])
def test_free_fingers_fill_a_box_of_ratios_from_a_friction_on(mass: float, least: float) -> None:
    share = least / (2.0 - 3.0 * least)
    threshold = (mass - share * (mass + 1.0)) / (mass - share * (mass - 1.0))
    given = {"well": 0.0, "align": 0.0, "finger_mass": mass, "v2": least}
    ends = [
        rw.simulate("two_finger_free", "dynamic-rigid", parameters=given | {"mu": mu}, tol=1e-3).outcome
        for mu in (threshold - 2e-3, threshold + 2e-3)
    ]
    assert ends == ["doomed", "goal"]


def test_prescribed_fingers_jam_where_friction_is_large(figure5: ModuleType) -> None:
    """Unless both touch at once: no speeds satisfy the quasistatic equations (7) of the paper."""
    run = rw.simulate("two_finger", "quasistatic-rigid", parameters={"mu": 1.05, "v2": 0.6})
    assert run.outcome == "jammed" and run.certificate is not None
    found = figure5.least_ratios(case(figure5, "prescribed"), np.array([0.95, 1.05]))
    assert found == pytest.approx([0.5, 1.0], abs=1e-3)


def test_a_finger_that_bounces_is_lost_where_nothing_brings_it_back(figure5: ModuleType) -> None:
    """The damped contact leaves a restitution of a hundredth, and friction stops the part."""
    given = {"well": 0.0, "align": 0.0, "mu": 1.2, "v2": 0.5}
    run = rw.simulate("two_finger_free", "dynamic-compliant", parameters=given)
    first = run.trajectory["velocity"].to_numpy()[-1, run.scene.template.coordinates.index("finger1.x1")]
    assert run.outcome == "timeout" and -0.011 < first < -0.005
    assert figure5.least_ratios(case(figure5, "free, compliant"), np.array([1.2])) > 0.9


def test_parts_of_the_box_in_closed_form(figure5: ModuleType) -> None:
    """Two triangles of 0.81 of a square of 3.61 are lost, as long as friction is below 1."""
    assert figure5.part_of_the_box(figure5.force_limited) == pytest.approx(1.0 - 1.62 / 3.61 / 1.5, abs=1e-3)


def test_the_page_has_the_table(figure5: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    figure5.print_ratios()
    said = [line.strip() for line in capsys.readouterr().out.splitlines()]
    page = [line.strip() for line in (ROOT / "docs" / "figure5.md").read_text("utf-8").splitlines()]
    first = page.index(said[0])
    assert same("\n".join(said), "\n".join(page[first : first + len(said)]))


def test_command_prints_and_draws(
    figure5: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(figure5, "SCANNED", 8)
    monkeypatch.setattr(figure5, "BISECTIONS", 4)
    monkeypatch.setattr(figure5, "print_ratios", list)
    monkeypatch.setattr(figure5, "DRAWN", tuple(case(figure5, name) for name in ("force-limited", "free")))
    assert figure5.main(["--tol", "0.05", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "figure5.png").stat().st_size > 50_000
    lines = [line for line in capsys.readouterr().out.splitlines() if "closed form 0." in line]
    for line in lines:
        found, exact = (float(line.split(word)[1][:5]) for word in ("Z_F ", "closed form "))
        assert found == pytest.approx(exact, abs=0.01)
    assert len(lines) == 2
