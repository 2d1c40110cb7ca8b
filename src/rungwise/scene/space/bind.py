"""Binding a scene in space: its model, laws of contact and start, with every number known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals, RecordArray
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.laws.contact import CHOICES
from rungwise.scene.language.expression import STACK, Programs, evaluate_all
from rungwise.scene.scene import InvalidScene
from rungwise.scene.space.assembly.parts import BALANCED, assembled
from rungwise.scene.space.fields import SpaceFile
from rungwise.scene.space.labels import Labels
from rungwise.scene.space.laws import contact_laws, give_friction, named_laws, sides_of
from rungwise.scene.space.meshes.pieces import with_pieces
from rungwise.scene.space.mujoco_model import change, compiled, targets
from rungwise.scene.space.numbers import FARTHEST
from rungwise.scene.space.refused import left_out, refuse
from rungwise.scene.space.settled import settled
from rungwise.scene.stated import Numbers
from rungwise.wording import choices

if TYPE_CHECKING:
    import mujoco


ROUNDED = 1e-12
"""Quaternions of a run are unit ones up to this."""


class Source(Protocol):
    """What binding asks of a scene: its file, the folder that it lies in, names, and programs that follow
    time."""

    @property
    def file(self) -> SpaceFile: ...
    @property
    def folder(self) -> Path: ...
    @property
    def template(self) -> Any: ...
    @property
    def labels(self) -> Labels: ...
    @property
    def told(self) -> Told: ...
    @property
    def conditions(self) -> Mapping[str, object]: ...


class Following(NamedTuple):
    """Programs (k,) of controls or of speeds, their fields, and the numbers (k,) of what they set."""

    programs: Programs
    fields: tuple[str, ...]
    numbers: Ints

    @classmethod
    def of(cls, scene: Source, kind: str, given: Mapping[str, object], known: Sequence[str]) -> Following:
        """Raises SceneError for unknown names."""
        names, fields = scene.template.names(), tuple(f"{kind}.{name}" for name in given)
        numbers = [_number_of(name, known, field) for name, field in zip(given, fields, strict=True)]
        texts = zip(given.values(), fields, strict=True)
        codes = [names.number(str(text), field, timed=True) for text, field in texts]
        return cls(Programs(codes), fields, np.array(numbers, np.int64))

    def tell(self, values: Reals, target: Reals) -> None:
        """Set a target's numbers from parameters and t (p + 1,). Raises InvalidScene."""
        found, programs = np.empty(len(self.numbers)), self.programs
        evaluate_all(programs.code, programs.constants, programs.table, values, np.empty(STACK), found)
        target[self.numbers] = found
        for k in np.flatnonzero(~np.isfinite(found)).tolist():
            raise InvalidScene(self.wrong(k, target, float(values[-1])))

    def wrong(self, k: int, target: Reals, time: float) -> str:
        """What is wrong with the value of program k."""
        return f"{self.fields[k]}: must be finite, not {target[self.numbers[k]]:g} at t = {time:g}"


class Told(NamedTuple):
    """What follows parameters and time."""

    controls: Following
    speeds: Following

    @classmethod
    def of(cls, scene: Source) -> Told:
        """Raises SceneError for unknown names."""
        file = scene.file
        return cls(
            Following.of(scene, "controls", file.controls, scene.labels.actuators),
            Following.of(scene, "speeds", file.speeds, scene.template.velocities),
        )


@dataclass(frozen=True, eq=False)
class SpaceBound:
    """A scene with every number known.

    law (g, g), laws (l, 8), named (l,): see `scene.space.laws`; place (n_q,), motion (n_v,), activation (k,):
    the start; numbers (a + n_v,) follow `told`: controls, and speeds, nan where a velocity is free; values
    (p + 1,): parameters and t.
    """

    model: mujoco.MjModel
    law: Ints
    laws: Reals
    named: RecordArray
    place: Reals
    motion: Reals
    activation: Reals
    numbers: Reals
    told: Told
    values: Reals
    tolerance: float
    duration: float
    step: float
    notes: tuple[str, ...] = ()

    @property
    def control(self) -> Reals:
        """Controls (a,)."""
        return self.numbers[: self.model.nu]

    @property
    def pace(self) -> Reals:
        """Speeds (n_v,), nan where a velocity is free."""
        return self.numbers[self.model.nu :]

    def tell(self, values: Reals) -> None:
        """Set controls and speeds from parameters and t (p + 1,). Raises InvalidScene."""
        for following, target in zip(self.told, (self.control, self.pace), strict=True):
            if following.fields:
                following.tell(values, target)

    def wrong(self, place: int, time: float) -> str:
        """What is wrong with a number that is not finite."""
        following, target, at = (
            (self.told.controls, self.control, place)
            if place < self.model.nu
            else (self.told.speeds, self.pace, place - self.model.nu)
        )
        return following.wrong(following.numbers.tolist().index(at), target, time)

    def step_in_mujoco(self, data: mujoco.MjData) -> None:
        """One step of MuJoCo's own loop (`mj_step`) with the scene's friction in place of the model's. Where
        these differ, Euler's method stands for that of Runge and Kutta, as in `mj_step2`."""
        import mujoco

        if np.isnan(self.laws[:, 5:]).all():
            mujoco.mj_step(self.model, data)
            return
        mujoco.mj_step1(self.model, data)
        if give_friction(data, self.law, self.laws):
            for follow in (
                mujoco.mj_makeConstraint, mujoco.mj_island, mujoco.mj_projectConstraint, mujoco.mj_fwdVelocity
            ):  # fmt: skip
                follow(self.model, data)
        mujoco.mj_step2(self.model, data)


def bind(scene: Source, values: Reals) -> SpaceBound:
    """The scene at parameters and t (p + 1,). Raises InvalidScene, naming the field, where it is impossible
    there."""
    return _bound(scene, values)[1]


def specified(scene: Source, given: Mapping[str, float]) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """The specification of the model at all parameters, with what settling its start changed, and the model.
    Raises InvalidScene."""
    spec, bound = _bound(scene, np.array([*given.values(), 0.0]))
    for number in np.flatnonzero(bound.model.body_mocapid >= 0).tolist():
        own = spec.body(bound.model.body(number).name)
        own.pos, own.quat = bound.model.body_pos[number], bound.model.body_quat[number]
    return spec, bound.model


def _bound(scene: Source, values: Reals) -> tuple[mujoco.MjSpec, SpaceBound]:
    """The specification that a scene is bound from, and the scene bound."""
    file = scene.file
    number = Numbers(scene.template.names(), values)
    spec, path, notes = assembled(file.model, scene.folder, number)
    change(targets(spec, file.model.set), number.one)
    try:
        model = compiled(spec, path)
        refuse(model)
        model, of_meshes = with_pieces(spec, model, path, file.model.meshes)
        law, laws = contact_laws(model, scene.labels, file.contacts, number.one)
        named = named_laws(model, law, file.contacts, file.tolerance, number.one)
    except SceneError as error:
        raise InvalidScene(str(error)) from None
    place, motion, control = _start(scene, model, number)
    key = _keyframe(scene, model)
    if spec.compiler.balanceinertia and path.suffix.lower() == ".urdf":
        notes = (f"model: {BALANCED}", *notes)
    if file.start.settle:
        fused = path.suffix.lower() == ".urdf"
        model, place, moved = settled(spec, model, scene.labels, place, fused)
        notes += moved
    bound = SpaceBound(
        model=model, law=law, laws=laws, named=named, place=place, motion=motion,
        activation=np.zeros(model.na) if key is None else model.key_act[key].copy(),
        numbers=np.append(control, np.full(model.nv, np.nan)), told=scene.told, values=values,
        tolerance=number.positive(file.tolerance, "tolerance"),
        duration=number.positive(file.duration, "duration"),
        step=number.positive(model.opt.timestep if file.step is None else file.step, "step"),
        notes=left_out(model) + of_meshes + notes,
    )  # fmt: skip
    bound.tell(values)
    return spec, bound


def check_names(scene: Source, spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Raise SceneError for a name that the scene's parameters or its model do not have, wherever the scene
    speaks of it, and for numbers that are no expressions."""
    file, template, names = scene.file, scene.template, scene.template.names()
    _ = scene.conditions, scene.told
    targets(spec, file.model.set)
    sides_of(model, scene.labels, file.contacts)
    _keyframe(scene, model)
    for path, given, known in (
        ("start.places", file.start.places, template.coordinates),
        ("start.velocities", file.start.velocities, template.velocities),
    ):
        for name in given:
            _number_of(name, known, f"{path}.{name}")
    bounds = {name: getattr(file, name) for name in ("tolerance", "duration", "step")}
    laws = [entry.model_dump(exclude={"between", *CHOICES}) for entry in file.contacts]
    parts = {
        name: part.model_dump(exclude={"file", "body"}) for name, part in file.model.parts.items()
    }  # fmt: skip
    servos = {name: servo.model_dump() for name, servo in file.model.servos.items()}
    rest = {"model.set": file.model.set.model_dump(), "contacts": laws}
    rest |= {"model.parts": parts, "model.servos": servos}
    start = {"start.places": file.start.places, "start.velocities": file.start.velocities}
    for path, text in _expressions(bounds | rest | start):
        names.number(text, path)


def _expressions(given: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """All numbers within, by path."""
    if isinstance(given, Mapping | list | tuple):
        items = given.items() if isinstance(given, Mapping) else enumerate(given)
        for key, each in items:
            yield from _expressions(each, f"{path}.{key}" if path else str(key))
    elif given is not None:
        yield path, str(given)


def _start(scene: Source, model: mujoco.MjModel, number: Numbers) -> tuple[Reals, Reals, Reals]:
    """q (n_q,), v (n_v,) and controls (a,) at the start."""
    start, template, key = scene.file.start, scene.template, _keyframe(scene, model)
    q, v, control = model.qpos0.copy(), np.zeros(model.nv), np.zeros(model.nu)
    if key is not None:
        q[:], v[:], control[:] = model.key_qpos[key], model.key_qvel[key], model.key_ctrl[key]
    for path, given, known, target in (
        ("start.places", start.places, template.coordinates, q),
        ("start.velocities", start.velocities, template.velocities, v),
    ):
        for name, text in given.items():
            value = number.one(text, f"{path}.{name}")
            if abs(value) > FARTHEST:
                raise InvalidScene(f"{path}.{name}: {value:g} must be within -{FARTHEST:g} to {FARTHEST:g}")
            target[known.index(name)] = value
    normalise(q, scene, "start.places", InvalidScene)
    return q, v, control


def _keyframe(scene: Source, model: mujoco.MjModel) -> int | None:
    """The number of the keyframe with which the scene starts."""
    name = scene.file.start.keyframe
    if name is None:
        return None
    keys = {model.key(k).name: k for k in range(model.nkey) if model.key(k).name}
    if name not in keys:
        raise SceneError(f"start.keyframe: unknown {name[:60]!r}{choices(name, list(keys))}")
    return keys[name]


def _number_of(name: str, known: Sequence[str], path: str) -> int:
    if name not in known:
        raise SceneError(f"{path}: unknown name{choices(name, known)}")
    return known.index(name)


def normalise(q: Reals, scene: Source, path: str, error: type[InputError]) -> None:
    """Make the quaternions in q (n_q,) unit ones, where they are not within rounding. Raises the error, in
    one line that names the field, for one that says no direction."""
    for at in scene.template.turns:
        turn = q[at : at + 4]
        length = math.hypot(*turn.tolist())
        if not np.finfo(float).tiny < length < math.inf:
            label = scene.template.coordinates[at][: -len("_qw")]
            given = ", ".join(f"{x:g}" for x in turn)
            raise error(f"{path}.{label}: the quaternion qw, qx, qy, qz is {given}; none is 1, 0, 0, 0")
        if abs(length - 1.0) > ROUNDED:
            turn /= length
