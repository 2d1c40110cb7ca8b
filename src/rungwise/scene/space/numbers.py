"""Numbers of a compiled model from which no motion can follow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.errors import SceneError

if TYPE_CHECKING:
    import mujoco

FARTHEST = 1e10
"""Farthest place, greatest size and fastest velocity, in the model's unit: MuJoCo takes what is more for a
fault."""
MOST = 1e75
"""Greatest of all other numbers: products of four are finite."""
PLACES = ("body_pos", "geom_pos", "geom_size", "site_pos", "jnt_pos", "qpos0", "key_qpos", "key_qvel")
SIGNED = (
    "body_mass", "body_inertia", "body_ipos", "body_iquat", "body_quat", "body_gravcomp", "geom_quat",
    "jnt_axis", "qpos_spring", "actuator_gainprm", "actuator_biasprm", "actuator_gear", "eq_data", "key_ctrl",
)  # fmt: skip
NOT_NEGATIVE = (
    "geom_friction", "pair_friction", "jnt_stiffness", "dof_damping", "dof_frictionloss", "dof_armature",
    "tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_armature",
)  # fmt: skip
OWNERS = {"geom": "geom", "body": "body", "jnt": "jnt", "tendon": "tendon", "actuator": "actuator",
          "eq": "equality", "key": "key", "site": "site"}  # fmt: skip
"""Prefixes of MuJoCo's arrays, and what MuJoCo calls what their rows are of."""


def check_numbers(model: mujoco.MjModel) -> None:
    """Raise SceneError for the first number that is not finite, too large, or negative where it must not be,
    naming its element and field as MuJoCo does."""
    for names, low, high in ((PLACES, -FARTHEST, FARTHEST), (SIGNED, -MOST, MOST), (NOT_NEGATIVE, 0.0, MOST)):
        for name in names:
            _check(model, name, getattr(model, name), low, high)
    _check(model, "gravity", model.opt.gravity, -MOST, MOST)


def _check(model: mujoco.MjModel, name: str, values: Reals, low: float, high: float) -> None:
    wrong = np.argwhere(~((values >= low) & (values <= high)))
    if len(wrong):
        value = float(values[tuple(wrong[0])])
        bounds = f"must be within {low:g} to {high:g}, not {value:g}"
        raise SceneError(f"model: {_named(model, name, int(wrong[0][0]))} {bounds}")


def _named(model: mujoco.MjModel, name: str, row: int) -> str:
    """What a row of an array is, in the words of the file."""
    prefix, _, field = name.partition("_")
    if prefix == "dof":
        prefix, row = "jnt", int(model.dof_jntid[row])
    if prefix not in OWNERS:
        return f"{name}.{row}:"
    own = getattr(model, OWNERS[prefix])(row).name or f"number {row}"
    return f"{'joint' if prefix == 'jnt' else OWNERS[prefix]} {own}: {field}"
