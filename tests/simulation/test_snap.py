"""A clip between two noses: rigid contacts jam it, and contacts that yield let it pass at a known force."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw

SNAP = rw.load("snap")
RIGID = ("kinematic", "quasistatic-rigid", "dynamic-rigid")
SOFT = ("quasistatic-compliant", "dynamic-compliant")
NOSE, ACROSS, K = 1e-3, 0.8e-3, 1e5
"""Radius of a nose, its centre across from the barb, and the stiffness of a contact, of the scene."""
AWAY = {"u": 0.0, "apart": 1.0, "seat": 1.0, "damping": 0.0, "drag": 1.0}


def touch(face: float, across: float = ACROSS) -> float:
    """How far the barb is from the noses when they touch the face before or behind it."""
    if math.cos(face) * NOSE > across:
        return (NOSE - across * math.cos(face)) / math.sin(face)
    return math.sqrt(NOSE**2 - across**2)


def force(face: float, mu: float, across: float = ACROSS) -> float:
    """Greatest force on the way over a face and round the barb, sampled over the angle of the contact."""
    angles = np.linspace(0.0, min(face, math.acos(across / NOSE)), 100_001)
    deep = NOSE - across / np.cos(angles)
    return float((2.0 * K * deep * (np.sin(angles) + mu * np.cos(angles))).max())


def loaded(load: float, model: str = "quasistatic-compliant", **given: float) -> float:
    """Where the barb comes to under a load alone, from the side from which the load pushes."""
    over = AWAY | {"start": -math.copysign(1.6e-3, load), "load": load} | given
    return rw.simulate(SNAP, model, parameters=over, tol=1e-7, duration=0.05).final["clip"]["x"]


def test_von_mises_truss() -> None:
    """Two springs of length L across which a point is pushed through: 2 K (L^(2/3) - c^(2/3))^(3/2)."""
    exact = 2.0 * K * (NOSE ** (2 / 3) - ACROSS ** (2 / 3)) ** 1.5
    assert force(1.0, 0.0) == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("model", RIGID)
@pytest.mark.parametrize("lead", [0.14, 0.5, 1.0])
def test_rigid_contacts_jam_where_the_noses_touch(model: str, lead: float) -> None:
    run = rw.simulate(SNAP, model, parameters={"lead": lead, "start": -3e-3})
    assert str(run.outcome) == "jammed" and run.certificate is not None
    assert run.final["clip"]["x"] == pytest.approx(-touch(lead), abs=1e-8)


@pytest.mark.parametrize("model", RIGID)
def test_with_room_rigid_contacts_pass(model: str) -> None:
    run = rw.simulate(SNAP, model, parameters={"interference": -1e-5})
    assert str(run.outcome) == "goal", run.reason


@pytest.mark.parametrize("model", SOFT)
def test_contacts_that_yield_snap(model: str) -> None:
    run = rw.simulate(SNAP, model)
    assert str(run.outcome) == "goal", run.reason


@pytest.mark.parametrize(("lead", "mu"), [(0.14, 0.0), (0.14, 0.2), (0.3, 0.5), (0.5, 0.0), (0.5, 0.5)])
def test_greatest_force_is_that_of_the_closed_form(lead: float, mu: float) -> None:
    given = {"lead": lead, "mu": mu, "damping": 0.0, "drag": 1.0, "start": -2e-3}
    run = rw.simulate(SNAP, "quasistatic-compliant", parameters=given, tol=1e-8, frames=10_000)
    forces = run.trajectory["contact_force"].sel(direction="normal", point="rod|clip/1/0").values
    assert forces.max() == pytest.approx(force(lead, mu) + 0.01, rel=3e-3)


@pytest.mark.parametrize(("lead", "back", "mu"), [(0.14, 1.0, 0.0), (0.14, 1.0, 0.2), (0.5, 0.3, 0.4)])
def test_loads_take_the_clip_in_and_out_from_that_force_on(lead: float, back: float, mu: float) -> None:
    given = {"lead": lead, "back": back, "mu": mu}
    for part, passes in ((0.9995, False), (1.0005, True)):
        assert (loaded(part * force(lead, mu), **given) > 0.0) == passes
        assert (loaded(-part * force(back, mu), **given) < 0.0) == passes


def test_stiffer_contacts_come_to_the_jam_of_rigid_ones() -> None:
    """A load F holds the barb F / (2 K sin a (sin a + mu cos a)) beyond the touch, a being the lead."""
    lead, mu, load = 0.14, 0.2, 6.0
    per = 2.0 * math.sin(lead) * (math.sin(lead) + mu * math.cos(lead))
    for stiffness in (1e5, 1e6, 1e8):
        place = loaded(load, stiffness=stiffness)
        assert place == pytest.approx(-touch(lead) + load / (stiffness * per), abs=1e-7)
    assert loaded(load, "quasistatic-rigid") == pytest.approx(-touch(lead), abs=1e-8)
    assert loaded(2.1 * load) < 0.0 < loaded(2.2 * load)  # 12.97 N: no more at ten times the stiffness
    assert loaded(2.2 * load, stiffness=1e6) < 0.0


def test_both_noses_push_alike() -> None:
    run = rw.simulate(SNAP, "quasistatic-compliant", frames=2000)
    forces = run.trajectory["contact_force"]
    lower, upper = (forces.sel(point=f"clip|{name}/0/0").values for name in ("lower", "upper"))
    np.testing.assert_allclose(lower[:, 0], upper[:, 0], atol=1e-9)
    np.testing.assert_allclose(lower[:, 1], -upper[:, 1], atol=1e-9)


def test_behind_the_neck_the_contacts_give_back_what_they_stored() -> None:
    """Without friction and damping the noses, each d deep at the neck, throw the clip off with K d^2."""
    given = {"mu": 0.0, "damping": 0.0, "drag": 0.0, "start": -1.6e-3, "v": 0.02, "apart": 1e-6}
    run = rw.simulate(SNAP, "dynamic-compliant", parameters=given, step=2e-6, theta=0.5, frames=3)
    energy = float(run.trajectory["kinetic_energy"].values[-1])
    assert str(run.outcome) == "goal"
    assert energy == pytest.approx(K * (NOSE - ACROSS) ** 2, rel=5e-3)


def test_a_contact_that_goes_round_a_corner_stays_the_same() -> None:
    """It keeps its deformation: a new contact, d deep, would push with C d / h besides K d."""
    for step in (1e-3, 1e-4):
        run = rw.simulate(
            SNAP, "quasistatic-compliant", parameters={"start": -2e-3}, step=step, frames=10_000
        )
        forces = run.trajectory["contact_force"].sel(direction="normal", point="clip|lower/0/0").values
        assert forces.max() == pytest.approx(K * (NOSE - ACROSS), rel=2e-3)
