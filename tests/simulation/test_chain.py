"""Derivatives of several steps against differences of runs."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.derivatives.assembly import Assembly
from rungwise.simulation.derivatives.steps import Start
from rungwise.simulation.planar.step.attempt import TAKEN, attempt

from .test_sensitivity import led_to

Array = np.ndarray
H, STEPS = 1e-3, 10
CASES = ("finger in the air", "finger pushes", "finger sticks", "disc slides", "disc rolls", "arm pushes")


def went(
    scene: rw.Scene, model: rw.Rung, parameters: dict[str, float], start: Start, theta: float, pause: float
) -> Array:
    """(q, v, deformation) after the steps. Overlap is taken back within a step, as what opens is."""
    at = Assembly(scene, model, scene.parameters(parameters), H, theta)
    at.workspace.terms.pause[0] = pause
    at.put(start)
    for _ in range(STEPS):
        assert at.set_speeds() == H
        assert attempt(at.records, at.rung, at.workspace, H, H) == TAKEN
        at.state.clock["time"] += H
    return np.concatenate([at.state.q, at.state.v, at.state.deformation.ravel()])


@pytest.mark.few(1)
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=lambda model: model.name)
@pytest.mark.parametrize("case", CASES)
def test_against_differences_of_runs(case: str, model: rw.Rung) -> None:
    scene, parameters, theta, time, state = led_to(case, model)
    start = Start(state.q.copy(), state.v.copy(), state.deformation.copy(), time)
    s = rw.run_sensitivity(
        scene, model, parameters, steps=STEPS, h=H, q=start.q, v=start.v, deformation=start.deformation,
        time=time, wrt=("q", "v", "deformation", "parameters"), theta=theta,
    )  # fmt: skip
    end = np.concatenate([s.q, s.v, s.deformation.ravel()])
    np.testing.assert_allclose(end, went(scene, model, parameters, start, theta, 2.0 * H), atol=1e-9)
    base = went(scene, model, parameters, start, theta, H)
    assert s.time == pytest.approx(time + STEPS * H)

    def check(kind: str, i: int, size: float, low: Array, high: Array) -> None:
        expected = (high - low) / (2.0 * size)
        if s.weak:  # one-sided: what begins to act must be more than the solver's tolerance
            expected = (high - base) / size
        got = np.concatenate([s.dq[kind][:, i], s.dv[kind][:, i], s.ddeformation[kind][:, i]])
        n = len(start.q)
        for part in (slice(0, n), slice(n, 2 * n), slice(2 * n, None)):
            scale = np.abs(expected[part]).max(initial=0.0)
            tolerance = (1e-3 if s.weak else 5e-5) * scale + 5e-9 / H
            np.testing.assert_allclose(
                got[part], expected[part], rtol=0.0, atol=tolerance, err_msg=f"{kind} {i}"
            )

    wide, at = 1e3 if s.weak else 1.0, Assembly(scene, model, scene.parameters(parameters), H, theta)
    for kind, size in (("q", 3e-7), ("v", 1e-6), ("deformation", 1e-7)):
        if kind == "q" and scene.name == "two_link" and model == rw.KINEMATIC:
            continue  # from joints that are torn its repeated linearisation may end elsewhere
        count = getattr(start, kind).size
        active = np.abs(start.deformation).ravel() > 0.0 if kind == "deformation" else np.ones(count, bool)
        for i in np.flatnonzero(active):
            by = wide * size * np.eye(count)[i]
            low, high = (
                went(scene, model, parameters, at.moved(start, kind, x), theta, H) for x in (-by, by)
            )
            check(kind, i, wide * size, low, high)
    for i, parameter in enumerate(s.names):
        value = scene.parameters(parameters)[parameter]
        if value == 0.0:
            continue  # restitution: whether a contact bounces is held
        size = 1e-5 * value
        low, high = (
            went(scene, model, {**parameters, parameter: value + x}, start, theta, H) for x in (-size, size)
        )
        check("parameters", i, size, low, high)


def test_a_chain_is_the_chain_of_its_steps() -> None:
    """With nothing about to change, derivatives are products of those of single steps."""
    scene, parameters = rw.load("two_finger"), {"v2": 0.7}
    run = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, parameters=parameters, duration=1.55, frames=3)
    assert run.workspace is not None
    state = run.workspace.state
    q, v, strain, time = state.q.copy(), state.v.copy(), state.deformation.copy(), run.time
    wrt = ("q", "v", "deformation", "inputs", "parameters")
    whole = rw.run_sensitivity(
        scene, rw.DYNAMIC_COMPLIANT, parameters, steps=3, h=H, q=q, v=v, deformation=strain, time=time,
        wrt=wrt,
    )  # fmt: skip
    assert not whole.weak
    total = {kind: np.zeros((2 * len(q) + strain.size, whole.dq[kind].shape[1])) for kind in wrt}
    for kind, first in (("q", 0), ("v", len(q)), ("deformation", 2 * len(q))):
        total[kind][first : first + total[kind].shape[1]] = np.eye(total[kind].shape[1])
    for _ in range(3):
        s = rw.step_sensitivity(
            scene, rw.DYNAMIC_COMPLIANT, parameters, q, v, H, wrt=wrt, deformation=strain, time=time
        )
        step = {kind: np.vstack([s.dq[kind], s.dv[kind], s.ddeformation[kind]]) for kind in wrt}
        state_to_state = np.hstack([step[kind] for kind in ("q", "v", "deformation")])
        total = {
            kind: state_to_state @ before + (step[kind] if kind in ("inputs", "parameters") else 0.0)
            for kind, before in total.items()
        }
        q, v, strain, time = s.q, s.v, s.deformation, time + H
    for kind in wrt:
        got = np.vstack([whole.dq[kind], whole.dv[kind], whole.ddeformation[kind]])
        np.testing.assert_allclose(got, total[kind], atol=1e-7 * max(np.abs(total[kind]).max(), 1.0))


def test_where_a_scene_starts_depends_on_its_parameters() -> None:
    """A disc that slides with friction mu g is at x = v0 t - mu g t^2 / 2, in steps of h: t (t + h) / 2."""
    s = rw.run_sensitivity(
        "slide_roll", rw.DYNAMIC_RIGID, {"mu": 0.3}, steps=50, h=H, wrt=("parameters",), names=("v0", "mu")
    )
    t = 50 * H
    assert s.time == pytest.approx(t)
    np.testing.assert_allclose(s.dq["parameters"][0], [t, -9.81 * t * (t + H) / 2.0], rtol=1e-6)
    np.testing.assert_allclose(s.dv["parameters"][0], [1.0, -9.81 * t], rtol=1e-6)


def test_inputs_act_in_every_step() -> None:
    """A finger that is faster by 1 goes t farther; a force f on the free part adds f t / m to its speed."""
    s = rw.run_sensitivity("two_finger", rw.DYNAMIC_RIGID, steps=10, h=H, wrt=("inputs",))
    t = 10 * H
    np.testing.assert_allclose(s.dq["inputs"], np.diag([t, t, t * (t + H) / 2.0]), atol=1e-11)
    np.testing.assert_allclose(s.dv["inputs"], np.diag([1.0, 1.0, t]), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"steps": 0}, "steps: must be a whole number"),
        ({"q": [0.0, 0.0, 0.0]}, "q and v: give both"),
        ({"wrt": ("speed",)}, "wrt: 'speed' is none of"),
        ({"names": ("weight",)}, "names: unknown parameter"),
        ({"h": -1.0}, "step: must be"),
        ({"deformation": [1.0]}, "deformation: must have shape"),
        (
            {"steps": 60, "h": 5e-2},
            r"step \d+, from time [\d.]+: .*(no step of this length|end of its travel)",
        ),
    ],
)
def test_wrong_input(change: dict[str, object], message: str) -> None:
    given = {"scene": "two_finger", "model": "quasistatic-rigid", "steps": 2, "h": 1e-2, "wrt": ("v",)}
    with pytest.raises(rw.ModelError, match=message):
        rw.run_sensitivity(**{**given, **change})  # type: ignore[arg-type]
