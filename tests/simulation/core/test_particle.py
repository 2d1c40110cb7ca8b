"""A particle over a floor, in steps whose answers are known in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rungwise as rw
from rungwise.contact.step import allocate_problem
from rungwise.models.assemble import approach, deform
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.stepping import stepper
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.moving import Moment, Size, fall_freely
from rungwise.system.terms import DRIVE, JOINT, Terms, allocate_terms

from .two_link_arm import AtMostOneContact, TwoLinkArm

Array = NDArray[np.float64]
H, G = 1e-3, 9.81


@dataclass
class Particle(AtMostOneContact):
    """At q = (x, y) over the floor y = 0; a row that moves x by gains (K, D), an aim and a limit."""

    q: Sequence[float] = (0.0, 0.0)
    v: Sequence[float] = (0.0, 0.0)
    mass: float = 1.0
    load: Sequence[float] = (0.0, 0.0)
    friction: float = 0.0
    restitution: float = 0.0
    stiffness: float = 1e4
    damping: float = 0.0
    drag: float = 0.0
    gains: Sequence[float] = (0.0, 0.0)
    aim: Sequence[float] = (0.0, 0.0)
    limit: float = 0.0
    account: int = DRIVE

    size = Size(2, 2, 1, 2, 1, 0.1)

    @property
    def driving(self) -> Array:
        return np.zeros(2)

    def start(self) -> tuple[Array, Array]:
        return np.array(self.q), np.array(self.v)

    def speeds(self, _time: float) -> Array:
        return np.array([nan, nan])

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Any, Any]:
        terms.inertia[:], terms.metric[:] = self.mass * np.eye(2), np.eye(2)
        terms.damping[:], terms.load[:] = self.drag * np.eye(2), self.load
        terms.limited[0], terms.limit[0], terms.gains[0] = (1.0, 0.0), self.limit, self.gains
        terms.error[0] = self.aim[0] - moment.q[0], self.aim[1]
        terms.account[0] = self.account
        fall_freely(terms, self.speeds(moment.time))
        gap = self.least_gap(moment.q)
        if gap > reach:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        rows = np.array([[0.0, 1.0], [1.0, 0.0]])
        return self.touch(terms, gap, rows, self.stiffness, self.damping), np.zeros(1, np.int64)

    def least_gap(self, q: Array) -> float:
        return float(q[1])

    def fastest(self, _q: Array, v: Array) -> float:
        return 2.0 * float(np.hypot(*v))

    def energy(self, q: Array, v: Array) -> float:
        return float(0.5 * self.mass * v @ v - q @ np.array(self.load))


def run(particle: Particle, rung: Rung, duration: float, h: float = H, theta: float = 1.0) -> Stepper:
    stepping = Stepper(particle, rung, h, theta)
    stepping.run(duration)
    return stepping


def test_controlled_steps_of_a_fall_have_the_error_that_is_allowed() -> None:
    """A step of first order errs by g h^2 / 2 in a fall; steps aim at 0.81 of what is allowed."""
    stepping, tol, h = Stepper(Particle((0.0, 9.0), load=(0.0, -G)), rw.DYNAMIC_RIGID, H), 1e-6, H
    for _ in range(12):
        h = stepping.advance(h, tol)
    assert h == pytest.approx(0.9 * sqrt(2.0 * tol / G), rel=1e-3)


@pytest.mark.parametrize("over", [0.98, 1.02])
def test_a_fall_from_a_height_that_counts_as_zero_is_rest(over: float) -> None:
    """After a height z a body falls at sqrt(2 g z): below this an approach is no impact."""
    terms, free, low = allocate_terms(1, 1, 0), np.zeros(1, np.int64), 1e-6
    terms.rows[0, 0], terms.fall[0], terms.low[0], terms.pause[0] = 1.0, -G, low, 1.0
    v = np.array([-over * sqrt(2.0 * G * low)])
    assert (approach(0, terms, v, np.zeros(1), free, 1, 1.0) == 0.0) == (over < 1.0)


def test_a_bounce_waits_for_the_floor_and_has_its_restitution() -> None:
    speed, e = 1.0, 0.6
    stepping = Stepper(Particle((0.0, 10.45 * H), (0.3, -speed), restitution=e), rw.DYNAMIC_RIGID, H)
    while stepping.v[1] < 0.0:
        gap = stepping.q[1]
        stepping.advance(H)
        assert stepping.time < 0.1
    assert gap < speed * H and stepping.v == pytest.approx([0.3, e * speed])


@pytest.mark.parametrize("h", [0.1 * H, H, 5.0 * H])
def test_overlap_comes_apart_in_no_less_than_a_pause(h: float) -> None:
    stepping = Stepper(Particle((0.0, -1e-6)), rw.DYNAMIC_RIGID, H)
    stepping.advance(h)
    assert stepping.v[1] == pytest.approx(1e-6 / max(h, stepper.PAUSE * H), rel=1e-6)


@pytest.mark.parametrize("h", [0.1 * H, H, 5.0 * H])
def test_an_open_joint_closes_in_no_less_than_half_a_pause(h: float) -> None:
    open_ = Particle((0.0, 9.0), gains=(inf, 0.0), aim=(1e-6, 0.0), limit=inf, account=JOINT)
    stepping = Stepper(open_, rw.DYNAMIC_RIGID, H)
    with np.errstate(invalid="ignore"):  # uncompiled, a stiffness without end times nothing is told
        stepping.advance(h)
    assert stepping.v[0] == pytest.approx(1e-6 / max(h, 0.5 * stepper.PAUSE * H), rel=1e-6)


def test_an_elastic_bounce_keeps_its_speed() -> None:
    """A quarter of a period in, a quarter out: at theta = 1/2 a spring returns what it takes."""
    stepping = run(Particle((0.0, 0.0), (0.0, -1.0)), rw.DYNAMIC_COMPLIANT, 0.05, 2e-5, theta=0.5)
    assert stepping.v[1] == pytest.approx(1.0, abs=1e-3)
    # At theta = 1 the scheme takes pi h / 2 T of it, with T = sqrt(M / K).
    stepping = run(Particle((0.0, 0.0), (0.0, -1.0)), rw.DYNAMIC_COMPLIANT, 0.05, 2e-5)
    assert stepping.v[1] == pytest.approx(1.0 - 0.5 * np.pi * 2e-5 / 1e-2, abs=1e-3)


@pytest.mark.parametrize("rung", [rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_COMPLIANT], ids=lambda rung: rung.name)
def test_a_contact_that_sticks_is_sheared_by_force_over_stiffness(rung: Rung) -> None:
    stepping = run(Particle(load=(3.0, -10.0), friction=0.5, damping=200.0), rung, 0.6)
    assert stepping.q == pytest.approx([3e-4, -1e-3], rel=1e-4)
    assert stepping.state.force[0] == pytest.approx([10.0, -3.0], rel=1e-4)


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
def test_a_deformation_without_force_decays_and_never_swings(theta: float) -> None:
    """K delta' + C (delta' - delta) / h = 0, whatever theta is."""
    terms, problem, after = allocate_terms(2, 1, 0), allocate_problem(2, 1, 0, 2), np.zeros(2)
    K, C = 1e4, 2.0
    terms.contact_stiffness[0], terms.contact_damping[0] = K * np.eye(2), C * np.eye(2)
    terms.deformation[:] = 1e-3, -2e-3
    problem.R[0] = np.eye(2) / (theta * H * K + C)
    deform(H, theta, terms, 0, np.zeros(2), problem, after)
    np.testing.assert_allclose(after, terms.deformation * C / (H * K + C), rtol=1e-12)


@pytest.mark.parametrize("rung", [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT], ids=lambda rung: rung.name)
@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_works_add_up_to_the_change_of_kinetic_energy(rung: Rung, theta: float) -> None:
    falling = Particle(
        (0.0, 0.01), (1.0, -1.0), load=(0.2, -G), friction=0.3, restitution=0.5, damping=5.0, drag=0.1,
        gains=(30.0, 2.0), aim=(0.1, 0.5), limit=2.0,
    )  # fmt: skip
    stepping = run(falling, rung, 0.2, theta=theta)
    names = ("drive_work", "load_work", "contact_work", "support_work", "joint_work")
    gained = 0.5 * (stepping.v @ stepping.v - 2.0)
    assert sum(float(stepping.clock[name]) for name in names) == pytest.approx(gained, abs=1e-12)
    assert stepping.clock["contact_work"] < -1e-3


def test_a_servo_takes_up_the_speed_that_it_is_asked_for() -> None:
    """K (x_d - x) + D (v_d - v) balances the load: without K the speed is v_d + f / D."""
    asked = Particle((0.0, 9.0), load=(0.5, 0.0), gains=(0.0, 10.0), aim=(0.0, 0.7), limit=inf)
    assert run(asked, rw.DYNAMIC_RIGID, 3.0, 1e-2).v[0] == pytest.approx(0.75, rel=1e-6)


def test_without_inertia_a_damper_takes_the_load_to_seven_digits() -> None:
    stepping = run(Particle((0.0, 9.0), load=(0.5, -0.2), drag=4.0), rw.QUASISTATIC_RIGID, 0.01)
    assert stepping.v == pytest.approx([0.125, -0.05], rel=2e-7)


@pytest.mark.parametrize(("limit", "code"), [(0.97, Code.UNSUPPORTED), (1.03, Code.RUNNING)])
def test_without_inertia_a_load_needs_a_drive_that_bears_it(limit: float, code: Code) -> None:
    pulled = Particle(load=(1.0, -1.0), gains=(0.0, 1e2), limit=limit)
    assert run(pulled, rw.QUASISTATIC_RIGID, 0.01).outcome == code


@pytest.mark.parametrize(("part", "code"), [(0.5, Code.RUNNING), (1.5, Code.MODEL_INVALID)])
def test_a_contact_may_yield_by_a_tenth_of_the_smallest_thing(part: float, code: Code) -> None:
    limit = 0.1 * Particle.size.length
    soft = Particle(load=(0.0, -10.0), stiffness=10.0 / (part * limit), damping=200.0)
    assert run(soft, rw.QUASISTATIC_COMPLIANT, 2.0, 1e-2).outcome == code


@pytest.mark.parametrize("h", [1e-3, 1e-2, 3e-2])
def test_a_driven_arm_slides_along_a_wall_without_shorter_steps(h: float) -> None:
    """Linearised again at its end, a step that would bend into the wall comes to it: where rods say."""
    bent = (0.6, 2.2)
    at = float(TwoLinkArm(bent).tip(np.array(bent))[0])
    stepping = Stepper(TwoLinkArm(bent, wall=at, driven=lambda _: (-0.5, nan)), rw.KINEMATIC, h)
    for _ in range(5):
        stepping.advance(h)
    first = bent[0] - 2.5 * h
    assert stepping.attempts == 5
    assert stepping.q == pytest.approx([first, np.arccos((at - np.cos(first)) / 0.8) - first], abs=1e-9)


def test_a_jam_is_told_with_its_proof_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    bent = (0.6, 0.9)
    at = float(TwoLinkArm(bent).tip(np.array(bent))[0]) + 0.01
    jammed = Stepper(TwoLinkArm(bent, wall=at, driven=lambda _: (-0.5, -0.5)), rw.KINEMATIC, 1e-3)
    assert jammed.run(0.3) == Code.JAMMED and jammed.certificate is not None
    monkeypatch.setattr(stepper, "ask", lambda *_: (None, False))
    unproved = Stepper(TwoLinkArm(bent, wall=at, driven=lambda _: (-0.5, -0.5)), rw.KINEMATIC, 1e-3)
    assert unproved.run(0.3) == Code.NOT_CONVERGED


class NewFeatures(Particle):
    """Its contact has new features in every step."""

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Any, Any]:
        slots, _ = super().fill(moment, terms, reach)
        return slots, np.ones(len(slots), np.int64)


@pytest.mark.parametrize("h", [1e-7, 1e-5, H])
@pytest.mark.parametrize("damping", [0.0, 10.0, 1e4])
@pytest.mark.parametrize("rung", [rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_COMPLIANT], ids=lambda rung: rung.name)
def test_what_rests_on_a_contact_that_yields_rests_on_new_features_of_it(
    rung: Rung, damping: float, h: float
) -> None:
    """A damper would push by its rate times the overlap over h if new features were not deformed."""
    sunk = G / 1e4
    stepping = Stepper(NewFeatures((0.0, -sunk), load=(0.0, -G), damping=damping), rung, h)
    for _ in range(20):
        stepping.advance(h)
    assert stepping.q[1] == pytest.approx(-sunk, rel=1e-6)
    assert stepping.state.force[0, 0] == pytest.approx(G, rel=1e-6)
