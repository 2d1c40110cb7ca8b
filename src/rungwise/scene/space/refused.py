"""What a model file may say that the six models have no counterpart for: refused in one line, or left out
with a remark. docs/space.md has the table."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.scene.errors import SceneError
from rungwise.scene.space.ranges import shared_ranges

if TYPE_CHECKING:
    import mujoco

BODY = 5
"""Number of MuJoCo's transmission that adheres."""
FILTERS = 3
"""Greatest of MuJoCo's numbers of actuators that act at once, after a filter, or by an integral."""
AFFINE = 1
"""Number of MuJoCo's affine bias."""
OF_JOINTS = 1
"""Number that MuJoCo gives to what a tendon of joints runs over."""
SWITCHES = ("ACTUATION", "CLAMPCTRL", "SPRING", "DAMPER")
"""Flags of MuJoCo that change motion when they are off and that MuJoCo's kinematics do not read."""

WAYS_OUT = {
    "an actuator with a state of another kind": 'dyntype="none" in the model file lets it act at once,'
    ' dyntype="filterexact" with a lag',
    "a fluid": 'density="0" viscosity="0" of <option> in the model file leave it out',
    "an actuator that adheres": "without it in the model file the rest runs",
    "a deformable body (flex)": "a rigid body in its place runs",
}
"""What can be written instead, by feature."""


def refuse(model: mujoco.MjModel) -> None:
    """Raise SceneError for the first feature that changes motion and has no counterpart."""
    for feature, where in _found(model):
        if where:
            way = f"; {WAYS_OUT[feature]}" if feature in WAYS_OUT else ""
            raise SceneError(
                f"model: {feature} has no counterpart in these models ({', '.join(where[:5])}){way}"
            )


def left_out(model: mujoco.MjModel) -> tuple[str, ...]:
    """Remarks on features that are left out."""
    remarks = []
    if not model.nv:
        remarks.append("model: nothing can move in it")
    if model.nmocap:
        remarks.append("model: mocap bodies stand still")
    if model.neq and (model.eq_active0 == 0).any():
        remarks.append("model: equalities that are inactive at the start stay so")
    return tuple(remarks)


def _found(m: mujoco.MjModel) -> list[tuple[str, list[str]]]:
    actuators = _named(m.nu, lambda i: m.actuator(i).name)
    joints = _named(m.njnt, lambda i: m.jnt(i).name)
    tendons = _named(m.ntendon, lambda i: m.tendon(i).name)
    geoms = _named(m.ngeom, lambda i: m.geom(i).name)
    pairs = [f"pair {i}" for i in range(m.npair)]
    fluid = [name for name in ("density", "viscosity") if getattr(m.opt, name)]
    return [
        ("a deformable body (flex)", [f"flex {i}" for i in range(m.nflex)]),
        ("a plugin", [f"plugin {i}" for i in range(m.nplugin)]),
        (
            "an actuator with a state of another kind",
            _of(actuators, m.actuator_dyntype > FILTERS),
        ),
        ("an actuator whose gain changes", _of(actuators, m.actuator_gaintype != 0)),
        ("an actuator whose bias is not affine", _of(actuators, m.actuator_biastype > AFFINE)),
        ("an actuator that adheres", _of(actuators, m.actuator_trntype == BODY)),
        ("an actuator that pushes away from its target", _of(actuators, _pushes_away(m))),
        ("a joint's stiffness that changes", _of(joints, _changing(m, "jnt_stiffnesspoly"))),
        ("a tendon's stiffness that changes", _of(tendons, _changing(m, "tendon_stiffnesspoly"))),
        ("a tendon's damping that changes", _of(tendons, _changing(m, "tendon_dampingpoly"))),
        ("a joint's damping that changes", ["joints"] if _changing(m, "dof_dampingpoly").any() else []),
        ("a joint's spring that yields", _of(joints, _changing(m, "jnt_springyield"))),
        ("a tendon's spring that yields", _of(tendons, _changing(m, "tendon_springyield"))),
        ("an actuator's damping that changes", _of(actuators, _changing(m, "actuator_dampingpoly"))),
        ("an actuator with a delay", _of(actuators, _changing(m, "actuator_delay"))),
        ("an actuator of several controls or forces", _of(actuators, _is_several(m))),
        ("a range of force that several actuators share", shared_ranges(m)),
        ("a contact that adheres", _of(geoms, _changing(m, "geom_adhesion"))),
        ("a contact that adheres", _of(pairs, _changing(m, "pair_adhesion"))),
        ("a surface that moves", _of(geoms, _changing(m, "geom_surfacevel"))),
        ("armature of a tendon that runs through space", _of(tendons, _heavy_tendons(m))),
        ("a flag", _flags(m)),
        ("a fluid", fluid),
    ]


def _changing(model: mujoco.MjModel, name: str) -> NDArray[np.bool_]:
    """Whether each element has terms of higher order, which earlier versions of MuJoCo do not know."""
    found = getattr(model, name, None)
    return np.zeros(0, bool) if found is None else np.any(found, axis=tuple(range(1, found.ndim)))


def _pushes_away(model: mujoco.MjModel) -> NDArray[np.bool_]:
    away = (model.actuator_biasprm[:, 1:3] > 0.0).any(axis=1)
    return np.asarray(away & (model.actuator_biastype == AFFINE))


def _is_several(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Whether each actuator has not one control and one force, as earlier versions of MuJoCo know alone."""
    if not hasattr(model, "actuator_outnum"):
        return np.zeros(0, bool)
    return np.asarray((model.actuator_outnum != 1) | (model.actuator_ctrlnum != 1))


def _heavy_tendons(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Whether each tendon has inertia and a direction that changes, whose force of inertia MuJoCo's recursive
    Newton-Euler algorithm leaves out."""
    through_space = model.wrap_type[model.tendon_adr] != OF_JOINTS
    return np.asarray((model.tendon_armature > 0.0) & through_space)


def _flags(model: mujoco.MjModel) -> list[str]:
    """Flags that change motion and are not as usual."""
    import mujoco

    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    found = [f"{name.lower()} off" for name in SWITCHES if off & getattr(bits, f"mjDSBL_{name}", 0)]
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE:
        found.append("override on")
    return found + (
        [f"actuatorgroupdisable {model.opt.disableactuator}"] if model.opt.disableactuator else []
    )


def _named(count: int, name: Callable[[int], str]) -> list[str]:
    return [name(i) or f"number {i}" for i in range(count)]


def _of(names: list[str], which: NDArray[np.bool_]) -> list[str]:
    return [name for name, is_one in zip(names, which, strict=False) if is_one]
