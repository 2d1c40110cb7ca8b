"""Equalities that say the same twice: a run with them is the run without."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.system.spatial.limited import agree
from tests.simulation.conftest import MOVING

from .conftest import Make

BARS = """<body name="{name}" pos="{x} 0 0"><joint name="{name}" axis="0 1 0" damping="20"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size=".02" contype="0" conaffinity="0"/>{more}</body>"""
ACROSS = """<body name="rod" pos="0 0 1"><joint name="rod" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size=".02" contype="0" conaffinity="0"/></body>"""
LEAST = '<joint joint1="left" joint2="right"/><joint joint1="left" joint2="rod" polycoef="0 -1 0 0 0"/>'
"""What closes the loop in rows that are independent."""
WELD = '<weld body1="base" body2="other"/>'
ONCE = '<connect body1="rod" body2="right" anchor="1 0 0"/>'
AGAIN = {
    "a connect in the plane alone": ONCE,
    "the same connect": 2 * ONCE,
    "the angles of a parallelogram": ONCE + '<joint joint1="left" joint2="right"/>',
    "the same angles twice": ONCE + 2 * '<joint joint1="left" joint2="right"/>',
    "an angle of the rod": ONCE + '<joint joint1="left" joint2="rod" polycoef="0 -1 0 0 0"/>',
    "a weld at the same place": LEAST + 2 * WELD,
}
"""What a loop of four bars is closed by."""


def loop(make: Make, equalities: str, turn: str, pull: float) -> rw.SpaceScene:
    """A parallelogram that falls in a plane that is turned in space; two bodies that a weld may hold."""
    bars = BARS.format(name="left", x=0, more=ACROSS) + BARS.format(name="right", x=1, more="")
    free = '<geom size=".05" mass="1" contype="0" conaffinity="0"/>'
    return make(
        f'<option gravity="{pull} 0 -9.81"/><worldbody><body name="base" euler="{turn}">{bars}</body>'
        f'<body name="other" pos="0 0 3"><freejoint/>{free}</body></worldbody>'
        f"<equality>{equalities}</equality>",
        duration=0.2, step=1e-3, start={"places": {"left.left": 0.3, "right.right": 0.3, "rod.rod": -0.3}},
    )  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
@pytest.mark.parametrize("turn", ["0 0 0", "20 35 -50", "90 0 0"])
@pytest.mark.parametrize("how", AGAIN)
def test_what_is_said_twice_is_said_once(make: Make, how: str, turn: str, rung: rw.Rung) -> None:
    """Two of the three joints are held, however it is said."""
    weld = WELD if "weld" in how else ""
    pull = 2.0
    runs = [rw.simulate(loop(make, each, turn, pull), rung) for each in (LEAST + weld, AGAIN[how])]
    assert [run.outcome.name for run in runs] == 2 * [runs[0].outcome.name], runs[1].reason
    assert runs[1].outcome not in ("jammed", "not_converged"), runs[1].reason
    if runs[0].outcome == "timeout":
        one, other = (run.final["left"]["left"] for run in runs)
        assert one == pytest.approx(other, abs=2e-3)
        assert runs[1].final["right"]["right"] == pytest.approx(other, abs=1e-6)


@pytest.mark.few(6)
@pytest.mark.parametrize("rung", ["quasistatic-rigid", "quasistatic-compliant"])
@pytest.mark.parametrize("seed", range(60))
def test_what_is_tied_to_a_damped_joint_moves_at_its_pace(make: Make, seed: int, rung: str) -> None:
    """A train of wheels: a torque turns the first against dampers of some, and nothing acts on the others."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    ratio = np.cumprod([1.0, *(rng.choice([-1, 1], count - 1) * rng.uniform(0.3, 3.0, count - 1))])
    damping = np.where(rng.permutation(count) < rng.integers(1, count), rng.uniform(0.5, 50.0, count), 0.0)
    bodies = "".join(
        f'<body name="w{i}" pos="{i} 0 0" euler="{rng.uniform(0, 90)} 0 0"><joint name="w{i}" '
        f'damping="{damping[i]}"/><geom size="{rng.uniform(0.02, 0.5)}" contype="0" conaffinity="0"/></body>'
        for i in range(count)
    )
    ties = [
        f'<joint joint1="w{i + 1}" joint2="w{i}" polycoef="0 {ratio[i + 1] / ratio[i]} 0 0 0"/>'
        for i in range(count - 1)
    ]
    far = '<body name="far" pos="0 0 9"><freejoint/><geom size=".1" mass="5"/></body>'
    scene = make(
        f"<worldbody>{bodies}{far}</worldbody><equality>{''.join(rng.permutation(ties))}"
        '<weld body1="far"/></equality><actuator><motor name="m" joint="w0" ctrlrange="-9 9"/></actuator>',
        duration=0.1, step=1e-2, parameters={"m": {"default": 2.0}}, controls={"m": "m"},
    )  # fmt: skip
    run = rw.simulate(scene, rung)
    assert run.outcome == "timeout", run.reason
    for i in range(count):
        turned = ratio[i] * 2.0 / (damping @ ratio**2) * 0.1
        assert run.final[f"w{i}"][f"w{i}"] == pytest.approx(turned, rel=1e-4)  # what inertia may make up


@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
def test_a_contradiction_is_still_one(make: Make, rung: rw.Rung) -> None:
    """Two joints that are to turn alike and against each other do not turn at all: one at a speed jams."""
    scene = loop(make, '<joint joint1="left" joint2="right"/>' * 2, "0 0 0", 0.0)
    assert rw.simulate(scene, rung, duration=0.01).outcome != "jammed"
    both = (
        '<joint joint1="left" joint2="right"/><joint joint1="left" joint2="right" polycoef="0.6 -1 0 0 0"/>'
    )
    scene = loop(make, both, "0 0 0", 0.0).changed(speeds={"left.left": 1.0})
    run = rw.simulate(scene, rung, duration=0.1)
    assert run.outcome == "jammed" and run.certificate is not None


@pytest.mark.parametrize("seed", range(5))
def test_rows_that_are_sums_of_others_ask_for_the_same_sum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, n = int(rng.integers(2, 6)), int(rng.integers(6, 12))
    base, error = rng.normal(size=(count, n)), rng.normal(size=count)
    parts = rng.normal(size=(int(rng.integers(1, 4)), count)) * 10.0 ** rng.uniform(-5, 5)
    noise = 1e-15 * rng.normal(size=(1, n)) * np.abs(parts @ base).max()
    rows = np.concatenate([base, parts @ base, noise])
    wanted = np.concatenate([error, parts @ error, [0.0]])
    told = wanted + np.concatenate([np.zeros(count), 1e-3 * rng.normal(size=len(parts)), [1.0]])
    own = np.column_stack([rows, told])
    agree(own, np.zeros_like(own))
    assert np.array_equal(own[:-1, :-1], rows[:-1]) and not own[-1].any()
    scale = 1.0 + np.abs(wanted).max()
    assert own[:, -1] == pytest.approx(wanted, abs=1e-9 * scale)
    apart = np.column_stack([base, error])
    kept = apart.copy()
    agree(kept, np.zeros_like(kept))
    assert np.array_equal(kept, apart)
