"""What equalities of a model hold together, in the names of the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rungwise.scene.space.labels import Labels

if TYPE_CHECKING:
    import mujoco


class Equality(NamedTuple):
    """Name, MuJoCo's kind, and the bodies, sites, joints or tendons on its sides; one side where the other is
    a constant."""

    name: str
    kind: str
    between: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.name} ({self.kind} of {' and '.join(self.between)})"


def equality(model: mujoco.MjModel, names: Labels, number: int) -> Equality:
    """An equality of the model."""
    import mujoco

    kind = mujoco.mjtEq(int(model.eq_type[number])).name.removeprefix("mjEQ_").lower()
    of_sites = int(model.eq_objtype[number]) == int(mujoco.mjtObj.mjOBJ_SITE)
    sides = (int(model.eq_obj1id[number]), int(model.eq_obj2id[number]))
    between = tuple(_side(model, names, "site" if of_sites else kind, side) for side in sides if side >= 0)
    return Equality(named(model.equality(number).name, number), kind, between)


def _side(model: mujoco.MjModel, names: Labels, kind: str, number: int) -> str:
    if kind == "joint":
        return names.velocities[int(model.jnt_dofadr[number])]
    if kind == "tendon":
        return named(model.tendon(number).name, number)
    return named(model.site(number).name, number) if kind == "site" else names.bodies[number]


def named(name: str, number: int) -> str:
    """The name of an element, or its number."""
    return name or f"number {number}"
