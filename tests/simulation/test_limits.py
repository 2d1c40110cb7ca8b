"""The limits that relate the rungs: stiffness to infinity, step to zero, inertia to zero."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw

STARTS = 1.5
"""When finger 1 of the two-finger scene meets the part at v1 = 1."""
ENDS = 1.58
"""Before finger 2 meets it, even where an elastic impact sends the part ahead at 2 v1."""


@pytest.fixture(scope="module")
def pushed() -> rw.Scene:
    """The two-finger scene without conditions, on a palm whose viscous drag on the part is `support`."""
    data = rw.load("two_finger").file.model_dump(mode="json") | {"goal": None, "doomed": None}
    data["parameters"]["support"] = {"default": 0.0, "range": [0.0, 1e6]}
    data["bodies"]["part"]["coordinates"]["x3"]["damping"] = "support"
    return rw.load(data)


def place(scene: rw.Scene, model: rw.Rung, parameters: dict[str, float], **options: Any) -> float:
    """x3 when finger 1 has pushed the part for ENDS - STARTS."""
    run = rw.simulate(scene, model, parameters={"v2": 0.6, **parameters}, duration=ENDS, frames=3, **options)
    assert run.outcome.name == "timeout" and run.time == pytest.approx(ENDS), run.reason
    return run.final["part"]["x3"]


def order(x: list[float], errors: list[float]) -> float:
    """Exponent p of errors ~ x^p, by regression."""
    return float(np.polyfit(np.log(x), np.log(errors), 1)[0])


@pytest.mark.parametrize("relaxation", [0.0, 0.01, 1.0])
@pytest.mark.parametrize(
    ("soft", "rigid", "stiffnesses"),
    [
        (rw.QUASISTATIC_COMPLIANT, rw.QUASISTATIC_RIGID, [1e4, 1e5, 1e6, 1e7]),
        (rw.DYNAMIC_COMPLIANT, rw.DYNAMIC_RIGID, [1e7, 1e8, 1e9, 1e10]),
    ],
    ids=("quasistatic", "dynamic"),
)
def test_compliant_tends_to_rigid_at_a_fixed_step(
    pushed: rw.Scene, soft: rw.Rung, rigid: rw.Rung, stiffnesses: list[float], relaxation: float
) -> None:
    """As 1/K with C = relaxation K, where h K outweighs M / h."""
    common = {"mu": 0.3, "support": 5.0}
    reference = place(pushed, rigid, common, step=1e-3)
    assert reference == pytest.approx(ENDS - STARTS, abs=1e-9)
    errors = [
        abs(place(pushed, soft, common | {"stiffness": k, "damping": relaxation * k}, step=1e-3) - reference)
        for k in stiffnesses
    ]
    assert order(stiffnesses, errors) == pytest.approx(-1.0, abs=0.01)


def test_quasistatic_offset_of_the_compliant_rung(pushed: rw.Scene) -> None:
    """The finger feels the drag d v through a normal and a sticking or sliding tangential spring."""
    drag, stiffness, mu = 5.0, 1e5, 0.3
    for damping in (0.0, 1e3):
        x3 = place(
            pushed,
            rw.QUASISTATIC_COMPLIANT,
            {"mu": mu, "support": drag, "stiffness": stiffness, "damping": damping},
            step=1e-4,
        )
        # lambda_n (1 - mu) / sqrt 2 = d v; the finger slides down the face, which yields by delta_n along its
        # normal, and so by sqrt 2 delta_n along the palm.
        normal = math.sqrt(2.0) * drag / (1.0 - mu)
        expected = math.sqrt(2.0) * normal / stiffness
        assert ENDS - STARTS - x3 == pytest.approx(expected, rel=2e-2)


@pytest.mark.parametrize(
    ("law", "limit", "exponent", "band"),
    [
        ("none", 2.0, -0.5, 0.01),
        ("proportional", 1.0, -1.0, 0.05),
        ("ratio", None, -0.5, 0.01),
    ],
)
def test_impacts_as_the_step_vanishes(
    pushed: rw.Scene, law: str, limit: float | None, exponent: float, band: float
) -> None:
    """C = 0 tends to e = 1 as K^-1/2, C ~ K to e = 0 as 1/K, and a damping ratio to its own e as K^-1/2."""
    ratio = 0.3
    if limit is None:
        angle = math.acos(ratio)
        limit = 1.0 + math.exp(-2.0 * ratio / math.sin(angle) * angle)
    stiffnesses = [1e6, 1e7, 1e8]
    errors = []
    for k in stiffnesses:
        # Along the palm stiffness and damping are K / 2 and C / 2, the mass is 1.
        damping = {"none": 0.0, "proportional": 1e-2 * k, "ratio": 2.0 * ratio * math.sqrt(2.0 * k)}[law]
        parameters = {"mu": 0.0, "stiffness": k, "damping": damping}
        x3 = place(pushed, rw.DYNAMIC_COMPLIANT, parameters, tol=1e-9, theta=0.5)
        errors.append(abs(x3 - limit * (ENDS - STARTS)))
    assert order(stiffnesses, errors) == pytest.approx(exponent, abs=band)


def test_speed_after_an_undamped_impact_is_elastic(pushed: rw.Scene) -> None:
    for stiffness in (1e6, 1e8):
        run = rw.simulate(
            pushed,
            rw.DYNAMIC_COMPLIANT,
            parameters={"v2": 0.6, "mu": 0.0, "stiffness": stiffness, "damping": 0.0},
            duration=ENDS,
            tol=1e-9,
            theta=0.5,
        )
        speed = float(run.trajectory.velocity.sel(coordinate="part.x3")[-1])
        assert speed == pytest.approx(2.0, abs=1e-3)


def damped(drive: dict[str, Any], damping: float, contact: bool, duration: float = 1.0) -> rw.Scene:
    """A finger, and maybe a block in front of it, on supports with drag."""
    finger = {
        "role": "robot",
        "mass": 0.5,
        "shape": {"kind": "disc", "radius": 5.0},
        "pose": {"x": -6.0},
        "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"damping": 1.0, "drive": drive}},
    }
    block = {
        "role": "object",
        "mass": 1.0,
        "shape": {"kind": "box", "width": 2.0, "height": 2.0},
        "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"damping": 2.0}},
    }
    between = {"between": ["finger", "block"], "stiffness": 50.0, "damping": damping}
    return rw.load(
        {
            "name": "damped",
            "bodies": {"finger": finger} | ({"block": block} if contact else {}),
            "contacts": [between] if contact else [],
            "duration": duration,
            "step": 1e-3,
        }
    )


SERVO = {"kind": "servo", "stiffness": 4.0, "damping": 0.5, "target": 0.5}
SPEED = {"kind": "speed", "speed": 0.3}


@pytest.mark.parametrize(
    ("model", "drive", "damping", "contact"),
    [
        (rw.QUASISTATIC_RIGID, SERVO, 0.0, False),
        (rw.QUASISTATIC_RIGID, SERVO, 0.0, True),
        (rw.QUASISTATIC_COMPLIANT, SERVO, 1.0, True),
        (rw.QUASISTATIC_COMPLIANT, SPEED, 1.0, True),
        (rw.QUASISTATIC_COMPLIANT, SPEED, 0.0, True),
    ],
)
def test_quasistatic_rung_is_the_limit_of_vanishing_inertia(
    model: rw.Rung, drive: dict[str, Any], damping: float, contact: bool
) -> None:
    """With order 1 where the supports have damping, after the boundary layer of length eps M / d."""
    scene = damped(drive, damping, contact)

    def final(rung: rw.Rung) -> np.ndarray[Any, Any]:
        run = rw.simulate(scene, rung, duration=0.1, frames=3)
        assert run.outcome.name == "timeout", run.reason
        return np.array([place["s"] for place in run.final.values()])

    reference = final(model)
    inertias = [1e-3, 1e-4, 1e-5]
    errors = [float(np.abs(final(model.with_inertia(eps)) - reference).max()) for eps in inertias]
    assert order(inertias, errors) == pytest.approx(1.0, abs=0.03)
    assert errors[0] > 1e-5


def test_without_damping_the_dynamic_run_does_not_depend_on_the_mass() -> None:
    """Prescribed speeds on a frictionless palm: no epsilon leads from the dynamic to the quasistatic rung."""
    scene = rw.load("two_finger")
    finals = []
    for restitution in (0.0, 0.7):
        for mass in 10.0 ** np.arange(-3.0, 4.0):
            parameters = {"v2": 0.83, "mu": 0.4, "mass": float(mass), "restitution": restitution}
            run = rw.simulate(scene, rw.DYNAMIC_RIGID, parameters=parameters, frames=3)
            assert run.outcome.name == "goal", run.reason
            finals.append(run.final["part"]["x3"])
    plastic, bouncing = np.array(finals[:7]), np.array(finals[7:])
    assert np.ptp(plastic) < 1e-12 and np.ptp(bouncing) < 1e-9


def test_inertia_lies_between_the_rungs() -> None:
    assert rw.QUASISTATIC_RIGID.with_inertia(1.0).record() == rw.DYNAMIC_RIGID.record()
    for wrong in (-0.1, 1.1, math.nan):
        with pytest.raises(ValueError, match="inertia"):
            rw.DYNAMIC_RIGID.with_inertia(wrong)
    for fixed in (rw.KINEMATIC, rw.GEOMETRIC):
        with pytest.raises(ValueError, match="inertia"):
            fixed.with_inertia(0.5)


def test_coupled_stiffness_of_a_contact() -> None:
    """A disc pressed on a floor with full K: at rest the deformation is K^-1 times the force."""
    disc = {
        "role": "object",
        "mass": 1.0,
        "inertia": 1.0,
        "shape": {"kind": "disc", "radius": 1.0},
        "pose": {"y": 1.0},
        "motion": {"kind": "free"},
        "force": [2.0, 0.0],
        "torque": 2.0,
    }
    contact = {"between": ["disc", "floor"], "friction": 2.0, "stiffness": 4e3, "damping": 80.0}
    contact |= {"tangential_stiffness": 2e3, "coupling_stiffness": 1e3, "coupling_damping": 10.0}
    bodies = {"disc": disc, "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}}}
    data = {"name": "coupled", "gravity": [0, -10], "bodies": bodies, "contacts": [contact], "duration": 6.0}
    data["step"] = 2e-3
    run = rw.simulate(data, rw.DYNAMIC_COMPLIANT)
    assert run.worst_residual <= 1e-8
    force = run.trajectory.contact_force.values[-1, 0]
    assert force == pytest.approx([10.0, -2.0], abs=2e-3)
    sunk = np.linalg.solve([[4e3, 1e3], [1e3, 2e3]], force)
    assert run.final["disc"]["y"] == pytest.approx(1.0 - sunk[0], abs=1e-6)
    # The contact point has moved by -sunk[1]: what the disc went and what it turned.
    assert run.final["disc"]["x"] + run.final["disc"]["angle"] == pytest.approx(-sunk[1], abs=1e-4)
    contact["coupling_stiffness"] = 3e3
    with pytest.raises(rw.SceneError, match="contacts between disc and floor: coupling must be below"):
        rw.load(data).bind()
