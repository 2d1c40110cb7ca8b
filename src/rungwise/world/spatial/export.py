"""Scenes in space for other programs: names of joints, and MJCF with keyframes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.fields.laws.contact import titles
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.bind import specified
from rungwise.scene.space.packages import with_files
from rungwise.simulation.moving.memory import memory_parts
from rungwise.simulation.spatial.memory import activations
from rungwise.simulation.state import State, digest
from rungwise.world.parts import ExportError

OWN_LAWS = "  <!-- The scene states laws of contact of its own ({}), which this file does not hold. -->\n"


def joints(scene: SpaceScene) -> dict[str, str]:
    """Coordinates of hinges and slides, and the model's names of these joints."""
    model, names = scene.bind().model, scene.template.coordinates
    single = np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE))
    found = {}
    for joint in single.tolist():
        name = names[int(model.jnt_qposadr[joint])]
        found[name] = model.jnt(joint).name or name
    return found


def mjcf(
    scene: SpaceScene, parameters: Mapping[str, float], states: Sequence[State], *, whole: bool = True
) -> str:
    """The model with a keyframe for each state, or the keyframes alone (see `world.export.mjcf`). Raises
    ExportError where MuJoCo does not read what it wrote."""
    keys = _keyframes(scene, parameters, states)
    if not whole:
        return f"<mujoco>\n{keys}</mujoco>\n"
    spec, model = specified(scene, parameters)
    with_files(spec, Path(spec.modelfiledir or scene.folder))
    for key in list(spec.keys):
        spec.delete(key)
    text, _, rest = spec.to_xml().rpartition("</mujoco>")
    named = ("friction, stiffness, damping, restitution", *titles(scene.bind(parameters).named))
    laws = OWN_LAWS.format(", ".join(named)) if scene.file.contacts else ""
    written = f"{text}{laws}{keys}</mujoco>{rest}"
    try:
        again = mujoco.MjModel.from_xml_string(written)
    except ValueError as error:
        why = " ".join(str(error).split())
        raise ExportError(f"mjcf: MuJoCo does not read what it wrote: {why}") from None
    if (again.nq, again.nv, again.nu, again.nbody) != (model.nq, model.nv, model.nu, model.nbody):
        raise ExportError("mjcf: MuJoCo reads a different model from the one that it wrote")
    return written


def _keyframes(scene: SpaceScene, parameters: Mapping[str, float], states: Sequence[State]) -> str:
    """The element <keyframe> of some states."""
    bound, own = scene.bind(parameters), digest(scene)
    lines = ["  <keyframe>\n"]
    for k, state in enumerate(states):
        values, activation = np.array([*parameters.values(), state.time]), bound.activation
        if state.memory is not None and state.memory.scene == own:
            memory = state.memory.values
            parts = memory_parts(scene, memory)
            values = memory[parts.values][: len(values)].copy()
            activation = activations(memory[parts.core], len(activation))
        bound.tell(values)
        fields = {"time": np.array([state.time]), "qpos": state.q, "qvel": state.v, "act": activation}
        fields["ctrl"] = bound.control
        told = "".join(f" {name}={quoteattr(_row(row))}" for name, row in fields.items() if len(row))
        lines.append(f'    <key name="state{k}"{told}/>\n')
    return "".join([*lines, "  </keyframe>\n"])


def _row(values: Reals) -> str:
    return " ".join(repr(value) for value in values.tolist())
