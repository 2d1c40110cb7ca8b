"""A scene in space that has been read: load it, and bind its numbers to a model."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.plain import cut
from rungwise.scene.expression import CONSTANTS, FUNCTIONS, STACK, Code, Programs, evaluate
from rungwise.scene.names import OF_CONTACTS, Names
from rungwise.scene.scene import InvalidScene, as_yaml, explain, parameter_values, read_yaml
from rungwise.scene.space.fields import SpaceFile
from rungwise.scene.space.labels import Labels, labels
from rungwise.scene.space.laws import contact_laws, smallest
from rungwise.scene.space.model import LIBRARY, change, compiled, model_path, read_spec
from rungwise.scene.space.refused import left_out, refuse
from rungwise.scene.task import numbers_of
from rungwise.scene.tasks import check_task
from rungwise.scene.template import STRICT, SceneError, out_of_range
from rungwise.wording import choices

if TYPE_CHECKING:
    import mujoco

    import rungwise

MODELS = (".xml", ".mjcf", ".urdf")
"""Endings of model files."""
ROUNDED = 1e-12
"""Quaternions of a run are unit ones up to this."""


@dataclass(frozen=True)
class SpaceTemplate:
    """What expressions, schedules and states speak of: names of parameters, inputs, bodies, coordinates
    (n_q,), velocities (n_v,), and pairs of bodies that may touch."""

    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    contacts: tuple[tuple[str, str], ...]

    def names(self) -> Names:
        """The names that expressions may use."""
        return Names(self.parameters, self.coordinates, self.contacts, self.velocities)

    @property
    def value_count(self) -> int:
        """Numbers that programs read: parameters, t, q, v, gaps, forces and impulses, tolerance."""
        moving = len(self.coordinates) + len(self.velocities)
        return len(self.parameters) + 2 + moving + len(OF_CONTACTS) * len(self.contacts)


@dataclass(frozen=True, eq=False)
class SpaceBound:
    """A scene with every number known.

    law (g, g), laws (l, 6): see `system.spatial.features`; place (n_q,), motion (n_v,): the start; control
    (a,) and pace (n_v,), nan where free, follow `told`: programs, and for each its field and the number of
    the control or speed; values (p + 1,): parameters and t.
    """

    model: mujoco.MjModel
    law: Ints
    laws: Reals
    place: Reals
    motion: Reals
    control: Reals
    pace: Reals
    told: Programs
    targets: tuple[tuple[str, int], ...]
    values: Reals
    tolerance: float
    duration: float
    step: float
    notes: tuple[str, ...] = ()

    def tell(self, values: Reals, kinds: Sequence[str] = ("controls", "speeds")) -> None:
        """Set controls and speeds, or one kind of them, from parameters and t (p + 1,)."""
        stack = np.zeros(STACK)
        for (path, index), (start, stop) in zip(self.targets, self.told.table, strict=True):
            kind = path.partition(".")[0]
            if kind not in kinds:
                continue
            target = self.control if kind == "controls" else self.pace
            value = float(evaluate(self.told.code, self.told.constants, start, stop, values, stack))
            if not np.isfinite(value):
                raise InvalidScene(f"{path}: must be finite, not {value:g} at t = {values[-1]:g}")
            target[index] = value


@dataclass(frozen=True)
class SpaceScene:
    """A task in space: the file as read, where it lies, the names of its model, and the model's text."""

    file: SpaceFile
    folder: Path
    template: SpaceTemplate
    labels: Labels
    model_text: str = field(repr=False)

    @property
    def name(self) -> str:
        return self.file.name

    def __repr__(self) -> str:
        moving = cut(", ".join(self.template.bodies[1:]), 120)
        parameters = cut(", ".join(self.file.parameters), 120)
        return f"<SpaceScene {cut(self.name)}: bodies {moving}; parameters {parameters or 'none'}>"

    @cached_property
    def content(self) -> str:
        """What tells scenes apart: the file's content and the model's, wherever its file lies."""
        model = self.file.model.model_copy(update={"file": Path(self.file.model.file).name})
        return (
            self.file.model_copy(update={"model": model}).model_dump_json(exclude_unset=True)
            + self.model_text
        )

    @property
    def size(self) -> float:
        """Radius of the smallest geom that moves and may touch."""
        return smallest(self.bind().model)

    @property
    def stored(self) -> str:
        """The scene as JSON, as `load` takes it once decoded, with the place of the model file, or its name
        alone if it ships."""
        path = model_path(self.file.model.file, self.folder).resolve()
        given = self.file.model_dump(mode="json", exclude_unset=True)
        shipped = path.parent == Path(str(LIBRARY)).resolve()
        return json.dumps(given | {"model": given["model"] | {"file": path.name if shipped else str(path)}})

    def yaml(self) -> str:
        """The scene as a file, with the place of the model file."""
        return as_yaml(json.loads(self.stored))

    def changed(self, **fields: Any) -> SpaceScene:
        """The scene with other fields of its file, such as its goal."""
        return replace(self, file=self.file.model_copy(update=fields))

    def task_numbers(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """The numbers of the task, by their paths, at these parameters. Raises InvalidScene for one that is
        out of its bounds."""
        number = _Numbers(self.template.names(), np.array([*self.parameters(given).values(), 0.0]))
        found = {}
        for place in () if self.file.task is None else numbers_of(self.file.task):
            value = found[place.path] = number.one(place.number, place.path)
            low = place.at_least if place.above is None else place.above
            wrong = out_of_range(value, low, place.at_most, 0 if place.above is None else STRICT)
            if wrong is not None:
                raise InvalidScene(f"{place.path}: {wrong}")
        return found

    @keywords
    def parameters(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameters, defaults replaced by those `given`. Raises SceneError as `Scene.parameters`."""
        return parameter_values(self.file.parameters, given)

    @cached_property
    def conditions(self) -> dict[str, Code]:
        """Programs of the conditions that the scene states."""
        names = self.template.names()
        stated = {name: getattr(self.file, name) for name in ("goal", "unsafe", "doomed")}
        return {name: names.condition(text, name) for name, text in stated.items() if text is not None}

    def goal(
        self, states: rungwise.States, parameters: Mapping[str, float] | None = None
    ) -> rungwise.Answers:
        """Whether the goal is reached at states, with signed margins (see `rungwise.ask`)."""
        import rungwise

        return rungwise.ask(self, "goal", states, parameters)

    def bind(self, given: Mapping[str, float] | None = None) -> SpaceBound:
        """The model at these parameters. Raises InvalidScene, naming the field, where it is impossible."""
        return _bind(self, np.array([*self.parameters(given).values(), 0.0]))


def _bind(scene: SpaceScene, values: Reals) -> SpaceBound:
    file, template, names = scene.file, scene.template, scene.template.names()
    number = _Numbers(names, values)
    changed = file.model.set
    path = model_path(file.model.file, scene.folder)
    spec = read_spec(path)
    groups = {
        group: {
            name: {key: number.all(each, f"model.set.{group}.{name}.{key}") for key, each in fields.items()}
            for name, fields in getattr(changed, group).items()
        }
        for group in ("geoms", "bodies", "joints", "actuators", "tendons")
    }
    change(spec, groups, {k: number.all(v, f"model.set.option.{k}") for k, v in changed.option.items()})
    model = compiled(spec, path)
    refuse(model)
    law, laws = contact_laws(model, scene.labels, file.contacts, number.one)
    place, motion, control = _start(scene, model, number)
    codes, targets = [], []
    for kind, given, known in (
        ("controls", file.controls, scene.labels.actuators),
        ("speeds", file.speeds, template.velocities),
    ):
        for name, text in given.items():
            if name not in known:
                raise SceneError(f"{kind}.{name}: unknown name{choices(name, known)}")
            codes.append(names.number(str(text), f"{kind}.{name}", timed=True))
            targets.append((f"{kind}.{name}", known.index(name)))
    bound = SpaceBound(
        model=model, law=law, laws=laws, place=place, motion=motion, control=control,
        pace=np.full(model.nv, np.nan), told=Programs(codes), targets=tuple(targets), values=values,
        tolerance=number.positive(file.tolerance, "tolerance"),
        duration=number.positive(file.duration, "duration"),
        step=number.positive(model.opt.timestep if file.step is None else file.step, "step"),
        notes=left_out(model),
    )  # fmt: skip
    bound.tell(values)
    return bound


@dataclass
class _Numbers:
    """Values of a scene's numbers at its parameters."""

    names: Names
    values: Reals
    stack: Reals = field(default_factory=lambda: np.zeros(STACK))

    def one(self, text: float | str, path: str) -> float:
        """The value of a number. Raises InvalidScene where it is none."""
        programs = Programs([self.names.number(str(text), path)])
        start, stop = programs.table[0]
        value = float(evaluate(programs.code, programs.constants, start, stop, self.values, self.stack))
        if not np.isfinite(value):
            raise InvalidScene(f"{path}: must be finite, not {value:g}")
        return value

    def all(self, given: Any, path: str) -> float | tuple[float, ...]:
        if isinstance(given, tuple):
            return tuple(self.one(each, f"{path}.{k}") for k, each in enumerate(given))
        return self.one(given, path)

    def positive(self, text: float | str, path: str) -> float:
        value = self.one(text, path)
        if not 0.0 < value < np.inf:
            raise InvalidScene(f"{path}: {value:g} must be > 0")
        return value


def _start(scene: SpaceScene, model: mujoco.MjModel, number: _Numbers) -> tuple[Reals, Reals, Reals]:
    """q (n_q,), v (n_v,) and controls (a,) at the start."""
    start = scene.file.start
    q, v, control = model.qpos0.copy(), np.zeros(model.nv), np.zeros(model.nu)
    if start.keyframe is not None:
        keys = {model.key(k).name: k for k in range(model.nkey) if model.key(k).name}
        if start.keyframe not in keys:
            raise SceneError(
                f"start.keyframe: unknown {start.keyframe[:60]!r}{choices(start.keyframe, list(keys))}"
            )
        key = keys[start.keyframe]
        q[:], v[:], control[:] = model.key_qpos[key], model.key_qvel[key], model.key_ctrl[key]
    for path, given, known, target in (
        ("start.places", start.places, scene.template.coordinates, q),
        ("start.velocities", start.velocities, scene.template.velocities, v),
    ):
        for name, text in given.items():
            if name not in known:
                raise SceneError(f"{path}.{name}: unknown name{choices(name, known)}")
            target[known.index(name)] = number.one(text, f"{path}.{name}")
    normalise(model, q)
    return q, v, control


def normalise(model: mujoco.MjModel, q: Reals) -> None:
    """Make the quaternions in q unit ones, where they are not within rounding."""
    import mujoco

    unit = q.copy()
    mujoco.mj_normalizeQuat(model, unit)
    if np.abs(unit - q).max() > ROUNDED:
        q[:] = unit


def is_space(source: object) -> bool:
    """Whether a source that `load` takes is a scene in space."""
    if isinstance(source, SpaceScene):
        return True
    if isinstance(source, Mapping):
        return "model" in source and "bodies" not in source
    if not isinstance(source, str | Path):
        return False
    if str(source) in shipped_in_space() or Path(source).suffix.lower() in MODELS:
        return True
    if Path(source).suffix.lower() not in (".yaml", ".yml") or not Path(source).is_file():
        return False
    content = read_yaml("scene", source)
    return isinstance(content, Mapping) and is_space(content)


def shipped_in_space() -> tuple[str, ...]:
    """Names of the scenes in space that come with the package."""
    return tuple(sorted(p.name.removesuffix(".yaml") for p in LIBRARY.iterdir() if p.name.endswith(".yaml")))


def load_space(source: SpaceScene | str | Path | Mapping[str, Any]) -> SpaceScene:
    """Read a scene in space: the name of one that ships, a YAML file or its content, or a model file. Raises
    SceneError: one line that names the field."""
    if isinstance(source, SpaceScene):
        return source
    if isinstance(source, Mapping):
        return _scene(dict(source), Path())
    if str(source) in shipped_in_space():
        folder = Path(str(LIBRARY))
        return _scene(read_yaml("scene", folder / f"{source}.yaml"), folder)
    path = Path(source)
    if path.suffix.lower() not in MODELS:
        return _scene(read_yaml("scene", path), path.parent)
    return _of_model(path)


def file_of(name: str) -> SpaceFile:
    """The fields of a scene that ships, without its model."""
    return _checked(read_yaml("scene", Path(str(LIBRARY)) / f"{name}.yaml"))


def _checked(data: Any) -> SpaceFile:
    try:
        return SpaceFile.model_validate(data)
    except ValidationError as error:
        raise SceneError(explain(error, data)) from None


def _scene(data: Any, folder: Path) -> SpaceScene:
    file = _checked(data)
    path = model_path(file.model.file, folder)
    spec = read_spec(path)
    model = compiled(spec, path)
    refuse(model)
    names = labels(model)
    scene = SpaceScene(file, folder, _template(file, model, names), names, spec.to_xml())
    _ = scene.conditions
    if file.task is not None:
        moving = [names.bodies[b] for b in range(model.nbody) if model.body_weldid[b]]
        check_task(file.task, scene.template.names(), file.inputs, moving)
    return scene


def _template(file: SpaceFile, model: mujoco.MjModel, names: Labels) -> SpaceTemplate:
    return SpaceTemplate(
        tuple(file.parameters),
        file.inputs,
        names.bodies,
        names.coordinates,
        names.velocities,
        tuple(
            (names.bodies[a], names.bodies[b])
            for a in range(model.nbody)
            for b in range(a + 1, model.nbody)
            if model.body_geomnum[a]
            and model.body_geomnum[b]
            and model.body_weldid[a] != model.body_weldid[b]
        ),
    )


def _of_model(path: Path) -> SpaceScene:
    """A scene of a model alone: its actuators are the inputs, and contacts have the laws of
    `contact_laws`."""
    if not path.is_file():
        raise SceneError(f"scene: {str(path)[:200]!r} is no file")
    model = compiled(read_spec(path), path)
    names = labels(model)
    parameters, controls = {}, {}
    taken = (*FUNCTIONS, *CONSTANTS, "t", "tolerance", "speed", *OF_CONTACTS)
    for a, name in enumerate(names.actuators):
        low, high = (float(x) for x in model.actuator_ctrlrange[a])
        own = f"u_{name}" if name in taken else name
        parameters[own] = {"default": 0.0, "about": f"control of {name}"}
        if model.actuator_ctrllimited[a]:
            parameters[own] |= {"default": min(max(0.0, low), high), "range": (low, high)}
        controls[name] = own
    from rungwise.scene.space.labels import label

    data = {
        "name": label(path.stem), "model": {"file": path.name}, "parameters": parameters,
        "inputs": tuple(parameters), "controls": controls,
    }  # fmt: skip
    return _scene(data, path.parent)
