"""Servos for joints that no actuator drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.scene.scene import InvalidScene
from rungwise.scene.space.fields import Servo
from rungwise.scene.space.mujoco_model import library, named
from rungwise.scene.stated import Numbers
from rungwise.wording import choices

if TYPE_CHECKING:
    import mujoco


def add_servos(spec: mujoco.MjSpec, servos: Mapping[str, Servo], numbers: Numbers | None) -> None:
    """Put servos on the hinges and slides that have a name and no actuator, by patterns of names, of which
    the first that fits holds: actuators of these names, whose control is the joint's place, within its range.
    Raises SceneError for a pattern that fits none."""
    mujoco = library()
    driven = {each.target for each in spec.actuators}
    single = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    free = {each.name: each for each in spec.joints if each.name and each.type in single}
    free = {name: each for name, each in free.items() if name not in driven}
    for pattern, servo in servos.items():
        path = f"model.servos.{pattern}"
        fitting = named(pattern, free)
        if not fitting:
            raise SceneError(
                f"model.servos: {shown(pattern)} names no joint without an actuator{choices(pattern, free)}"
            )
        for name in fitting:
            _add(spec, free.pop(name), servo, path, numbers)


def _add(spec: mujoco.MjSpec, joint: Any, servo: Servo, path: str, numbers: Numbers | None) -> None:
    trntype = library().mjtTrn.mjTRN_JOINT
    own = spec.add_actuator(name=joint.name, target=joint.name, trntype=trntype)
    stiffness, damping = 1.0, 0.0
    if numbers is not None:
        stiffness = numbers.positive(servo.stiffness, f"{path}.stiffness")
        damping = numbers.one(servo.damping, f"{path}.damping")
        if damping < 0.0:
            raise InvalidScene(f"{path}.damping: {damping:g} must be >= 0")
        if servo.force is not None:
            most = numbers.positive(servo.force, f"{path}.force")
            own.forcerange, own.forcelimited = (-most, most), True
    own.set_to_position(kp=stiffness, kv=damping)
    if joint.range[0] < joint.range[1]:
        own.inheritrange = 1.0
