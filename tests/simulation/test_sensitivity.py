"""Derivatives of a step against differences of steps that the simulation takes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.derivatives.assembly import Assembly
from rungwise.simulation.derivatives.steps import Start
from rungwise.simulation.planar.step.attempt import TAKEN, attempt

Array = np.ndarray
H = 1e-3
CASES = {
    "finger in the air": ("two_finger", {"v2": 0.7}, 0.5),
    "finger pushes": ("two_finger", {"v2": 0.7}, 1.55),
    "finger sticks": ("two_finger_servo", {"mu": 1.5, "v2": 0.7}, 1.55),
    "disc slides": ("slide_roll", {"mu": 0.3, "damping": 1e3}, 0.1),
    "disc rolls": ("slide_roll", {"mu": 2.0, "spin0": -10.0}, 0.01),
    "arm on joints": ("two_link", {}, 0.3),
    "arm pushes": ("two_link", {}, 1.6),
    "servo fingers": ("two_finger_servo", {"v2": 0.7}, 1.55),
}


class Led(NamedTuple):
    """A scene, its parameters, a theta for the model, and where the run has come to at a time."""

    scene: rw.Scene
    parameters: dict[str, float]
    theta: float
    time: float
    state: Any


def led_to(case: str, model: rw.Rung) -> Led:
    name, parameters, until = CASES[case]
    scene, theta = rw.load(name), 0.75 if model == rw.DYNAMIC_COMPLIANT else 1.0
    run = rw.simulate(scene, model, parameters=parameters, duration=until, frames=3)
    assert isinstance(scene, rw.Scene) and run.workspace is not None
    return Led(scene, parameters, theta, run.time, run.workspace.state)


def taken(
    scene: rw.Scene,
    model: rw.Rung,
    parameters: dict[str, float],
    start: Array,
    strain: Array,
    theta: float,
    pause: float = H,
) -> Array:
    """(q, v) after one step of the simulation from `start`.

    Overlap is taken back within the step, as what opens is: over a pause, the two would have two slopes.
    """
    at = Assembly(scene, model, scene.parameters(parameters), H, theta)
    at.workspace.terms.pause[0] = pause
    at.put(Start(*np.split(start, 2), strain))
    assert at.set_speeds() == H
    assert attempt(at.records, at.rung, at.workspace, H, H) == TAKEN
    return np.concatenate([at.state.q, at.state.v])


@pytest.mark.few(2)
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=lambda model: model.name)
@pytest.mark.parametrize("case", CASES)
def test_against_steps_taken(case: str, model: rw.Rung) -> None:
    scene, parameters, theta, _, state = led_to(case, model)
    start, strain = np.concatenate([state.q, state.v]), state.deformation.copy()
    n = len(state.q)
    s = rw.step_sensitivity(scene, model, parameters, state.q, state.v, H, deformation=strain, theta=theta)
    as_usual = taken(scene, model, parameters, start, strain, theta, pause=2.0 * H)
    np.testing.assert_allclose(np.concatenate([s.q, s.v]), as_usual, rtol=0.0, atol=1e-11)
    base = taken(scene, model, parameters, start, strain, theta)
    one_sided = bool(s.contact.weak or s.contact.weak_rows)
    wide = 1e3 if one_sided else 1.0  # what begins to act must be more than the solver's tolerance

    def check(kind: str, i: int, steps: dict[float, Array]) -> None:
        (a, low), (b, high) = sorted(steps.items())
        if one_sided:
            a, low = 0.0, base
        expected = (high - low) / (b - a)
        got = np.concatenate([s.dq[kind][:, i], s.dv[kind][:, i]])
        tolerance = (1e-4 if one_sided else 1e-6) * np.abs(expected).max() + 1e-9 / H
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance, err_msg=f"{kind} {i}")

    for i in range(2 * n):
        kind, size = ("q", 1e-7) if i < n else ("v", 1e-6)
        size *= wide
        steps = {
            by: taken(scene, model, parameters, start + by * np.eye(2 * n)[i], strain, theta)
            for by in (-size, size)
        }
        check(kind, i % n, steps)
    for i, parameter in enumerate(s.names):
        value = scene.parameters(parameters)[parameter]
        if value == 0.0:
            continue  # restitution: whether a contact bounces is held
        steps = {
            by: taken(scene, model, {**parameters, parameter: value + by}, start, strain, theta)
            for by in (-1e-5 * value, 1e-5 * value)
        }
        check("parameters", i, steps)


@pytest.mark.parametrize("theta", [0.6, 1.0])
def test_deformations_after_a_step_by_parameters(theta: float) -> None:
    """A contact that pushes, stiffer or more damped, against steps that the simulation takes."""
    scene, model, given = rw.load("two_finger_servo"), rw.DYNAMIC_COMPLIANT, {"mu": 1.5, "v2": 0.7}
    run = rw.simulate(scene, model, parameters=given, duration=1.51, frames=3)
    assert run.workspace is not None and run.workspace.state.force.max() > 0.0
    state = run.workspace.state
    q, v, strain = state.q.copy(), state.v.copy(), state.deformation.copy()
    names = ("stiffness", "damping")
    s = rw.step_sensitivity(
        scene, model, given, q, v, H, deformation=strain, theta=theta, wrt=("parameters",), names=names
    )
    for i, name in enumerate(names):
        value, after = scene.parameters(given)[name], []
        for by in (-1e-5 * value, 1e-5 * value):
            at = Assembly(scene, model, scene.parameters({**given, name: value + by}), H, theta)
            at.put(Start(q, v, strain))
            at.set_speeds()
            assert attempt(at.records, at.rung, at.workspace, H, H) == TAKEN
            after.append(at.state.deformation.ravel().copy())
        expected = (after[1] - after[0]) / (2e-5 * value)
        assert np.abs(expected).max() > 0.0
        got = s.ddeformation["parameters"][:, i]
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-4 * np.abs(expected).max())


def test_inputs_by_hand() -> None:
    """A finger at speed v moves by h v; a force f on the free disc adds h f / m to its speed."""
    scene = rw.load("two_finger")
    s = rw.step_sensitivity(scene, rw.DYNAMIC_RIGID, None, [0, 0, 0], [1, 1, 0], H, wrt=("inputs",))
    np.testing.assert_allclose(s.dq["inputs"], H * np.diag([1.0, 1.0, H]), atol=1e-12)
    np.testing.assert_allclose(s.dv["inputs"], np.diag([1.0, 1.0, H]), atol=1e-9)
    assert set(s.dq) == {"inputs"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wrt": ("speed",)}, "wrt: 'speed' is none of"),
        ({"names": ("weight",)}, "names: unknown parameter 'weight'"),
        ({"q": [0.0]}, "q: must be 3 finite numbers"),
        ({"deformation": [0.0]}, "deformation: must have shape"),
        ({"q": [2.0 - 1e-4, 0.0, 0.0]}, "end of its travel"),
        ({"model": "geometric"}, "does not say how bodies move"),
    ],
)
def test_wrong_input(change: dict[str, object], message: str) -> None:
    given = {"scene": "two_finger", "model": "dynamic-rigid", "parameters": None, "q": np.zeros(3),
             "v": np.zeros(3), "h": H}  # fmt: skip
    with pytest.raises(rw.ModelError, match=message):
        rw.step_sensitivity(**{**given, **change})  # type: ignore[arg-type]
