"""The picture of a run: outlines, poses and contact points of each frame, derived from its trajectory.

A trajectory holds coordinates, modes and forces, but no places: bodies and contact points are placed again
here, by the kernels that placed them in the run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import BACKWARD, FORWARD, OPEN, STICK
from rungwise.models.ladder import Rung
from rungwise.outcome import Outcome
from rungwise.scene import Scene, SceneError
from rungwise.scene.read import load_planar
from rungwise.scene.template.records import FIXED, FREE, HALFPLANE, HINGE, Records
from rungwise.simulation import trajectory as saved
from rungwise.simulation.planar.state.allocation import allocate
from rungwise.simulation.planar.state.workspace import in_memory
from rungwise.simulation.raised import raised_in
from rungwise.simulation.result import Run
from rungwise.simulation.state import State, digest, memory_of
from rungwise.system.planar import contact_manifold
from rungwise.system.planar.corners import allocate_course
from rungwise.system.planar.find_contacts import find_contacts
from rungwise.system.planar.place import X, Y, allocate_placement, place
from rungwise.system.planar.seams import allocate_seams, find_seams
from rungwise.viewing.goal import NEAR_GOAL, goal_places
from rungwise.viewing.units import units_of

if TYPE_CHECKING:
    import xarray

NEAR = 0.02
"""Open contact points are shown up to this fraction of the largest shape's reach."""
EXACT = 500
"""Up to so many pairs of shapes every gap is exact; with more pairs, far gaps are lower bounds, as in the
run."""

SHOWN_OPEN, SHOWN_STICK, SHOWN_SLIP = 0, 1, 2
"""Modes as they are drawn; the two slipping modes look alike."""
_SHOWN = np.zeros(4, np.int64)
_SHOWN[[OPEN, STICK, FORWARD, BACKWARD]] = SHOWN_OPEN, SHOWN_STICK, SHOWN_SLIP, SHOWN_SLIP


@dataclass(frozen=True)
class Outline:
    """A shape in the frame of its body's centre of mass: core vertices (k, 2) counter-clockwise, with the
    normals (k, 2) of the edges that start there, grown by `radius`. A half-plane is one point and its normal.
    """

    body: int
    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    radius: float
    halfplane: bool


@dataclass(frozen=True)
class Touches:
    """Contact points of all frames, one row each, in the order of frames.

    frame, contact (numbers); place (k, 2); force (k, 2) on the first body of the contact, world
    axes; mode: one of `SHOWN_OPEN`, `SHOWN_STICK`, `SHOWN_SLIP`.
    """

    frame: NDArray[np.int64]
    contact: NDArray[np.int64]
    place: NDArray[np.float64]
    force: NDArray[np.float64]
    mode: NDArray[np.int64]


@dataclass(frozen=True)
class Clip:
    """A run, ready to be drawn.

    `pose` is (frames, bodies, 3): place of the centre of mass, and the angle turned. `gap` and `push`
    (frames, contacts) are the least gap and the normal force of each contact; `push_is` says which quantity
    `push` holds, and `units` what is known of the scene's (see `units_of`). A joint is a body and a point
    of this body, in its own frame. `raised` (frames, bodies) is how high bodies are above the plane. `goal`
    (bodies, 3) are poses that the goal wants, nan where it wants none (see `goal_places`).
    """

    scene: str
    model: str
    outcome: str
    reason: str
    parameters: dict[str, float]
    bodies: tuple[str, ...]
    roles: tuple[str, ...]
    moving: NDArray[np.bool_]
    contacts: tuple[str, ...]
    outlines: tuple[Outline, ...]
    joints: tuple[tuple[int, float, float], ...]
    time: NDArray[np.float64]
    pose: NDArray[np.float64]
    gap: NDArray[np.float64]
    push: NDArray[np.float64]
    push_is: str
    touches: Touches
    units: Mapping[str, str]
    raised: NDArray[np.float64]
    goal: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def wanted(self) -> list[int]:
        """Bodies for which the goal wants a pose."""
        return np.flatnonzero(np.isfinite(self.goal).all(axis=1)).tolist()

    def thinned(self, frames: NDArray[np.int64]) -> Clip:
        """The clip with these frames only."""
        new = np.full(len(self.time), -1)
        new[frames] = np.arange(len(frames))
        t = self.touches
        kept = new[t.frame] >= 0
        touches = Touches(new[t.frame[kept]], t.contact[kept], t.place[kept], t.force[kept], t.mode[kept])
        return replace(
            self, time=self.time[frames], pose=self.pose[frames], gap=self.gap[frames],
            push=self.push[frames], touches=touches, raised=self.raised[frames],
        )  # fmt: skip


def clip(source: Run | str | Path) -> Clip:
    """Clip of a run, or of the folder of a saved run.

    Raises SceneError when the folder holds no run, or a run that does not name its scene.
    """
    if isinstance(source, Run):
        try:
            return of_trajectory(source.scene, source.parameters, source.trajectory)
        except ValueError as error:
            raise SceneError(f"view: {error}") from None
    try:
        data, summary = saved.read_saved(source)
    except (OSError, ValueError) as error:
        raise SceneError(f"view: {error}") from None
    file = data.attrs.get("scene_file")
    scene = load_planar(json.loads(file) if file is not None else summary["scene"])
    return of_trajectory(scene, summary["parameters"], data)


def _told(attributes: Mapping[str, Any]) -> str:
    """Why the run ended; of a goal without the next rung, which runs side by side show."""
    if attributes.get("outcome") == Outcome.GOAL:
        return Outcome.GOAL.meaning
    return str(attributes.get("reason", ""))


def of_trajectory(scene: Scene, parameters: Mapping[str, float], data: xarray.Dataset) -> Clip:
    """Clip of a run's recorded frames (see `trajectory.dataset`)."""
    force, push_is = _forces(data, data["time"].to_numpy())
    heights = {} if "raised" not in data else {
        str(name): data["raised"].to_numpy()[:, k] for k, name in enumerate(data["body"].to_numpy())
    }  # fmt: skip
    return _clip(
        scene, parameters, data.attrs["model"], (data.attrs.get("outcome", ""), _told(data.attrs)),
        data["time"].to_numpy(), data["position"].to_numpy(), data["mode"].to_numpy(), force, push_is,
        heights,
    )  # fmt: skip


def still(scene: Scene, model: Rung, parameters: Mapping[str, float], state: State) -> Clip:
    """Clip of one frame, a state; forces are those that its run found there, where a force is one and no
    impact."""
    bound = scene.bind(parameters)
    like = allocate(scene.template, bound.values, 3).state
    mode, force, push_is = like.modes[None], like.force[None], ""
    memory = memory_of(state, digest(scene), like)
    heights = {}
    if memory is not None:
        heights = raised_in(scene, in_memory(like, "values", memory.values[None]))
        mode = in_memory(like, "modes", memory.values[None])
        if model.loads and (model.compliant or model.inertia == 0.0):
            force, push_is = in_memory(like, "force", memory.values[None]), "normal force"
    time, q = np.array([state.time]), state.q[None]
    return _clip(scene, parameters, model.name, ("", ""), time, q, mode, force, push_is, heights)


def _clip(
    scene: Scene,
    parameters: Mapping[str, float],
    model: str,
    ended: tuple[str, str],
    time: NDArray[np.float64],
    q: NDArray[np.float64],
    mode: NDArray[Any],
    force: NDArray[np.float64],
    push_is: str,
    heights: Mapping[str, NDArray[np.float64]],
) -> Clip:
    """Clip of frames: q (frames, n), mode (frames, points) and force (frames, points, 2), heights (frames,)
    of bodies that may be raised."""
    records, template = scene.bind(parameters).records, scene.template
    raised = np.zeros((len(q), len(template.bodies)))
    for name, height in heights.items():
        raised[:, template.bodies.index(name)] = height
    pose, touches, gap = _replay(
        records, np.ascontiguousarray(q, float), mode.astype(np.int64), force, raised
    )
    return Clip(
        scene=scene.name,
        model=model,
        outcome=ended[0],
        reason=ended[1],
        parameters=dict(parameters),
        bodies=template.bodies,
        roles=tuple(scene.file.bodies[name].role for name in template.bodies),
        moving=records.bodies["motion"] != FIXED,
        contacts=tuple(" | ".join(pair) for pair in template.contacts),
        outlines=_outlines(records),
        joints=tuple((int(j["body_b"]), float(j["b_x"]), float(j["b_y"])) for j in records.joints),
        time=time,
        pose=pose,
        gap=gap,
        push=_pushes(records, force),
        push_is=push_is,
        touches=touches,
        units=units_of(scene.file),
        raised=raised,
        goal=_goal(scene, parameters, q[-1]),
    )


def _goal(scene: Scene, parameters: Mapping[str, float], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses (bodies, 3) that the goal wants, with other coordinates as in q (n,); nan where it wants none."""
    template, places = scene.template, goal_places(scene, parameters)
    pose, records = np.full((len(template.bodies), 3), np.nan), scene.bind(parameters).records
    reach = np.where(np.isfinite(records.shapes["reach"]), records.shapes["reach"], 0.0)
    wanted = []
    for number, name in enumerate(template.bodies):
        own = {each for each in template.coordinates if each.partition(".")[0] == name}
        needed = own - {f"{name}.angle"} if len(own) == 3 else own
        near = NEAR_GOAL * float(reach[records.shapes["body"] == number].max(initial=0.0))
        if own and all(each in places and places[each].within <= near for each in needed):
            wanted.append(number)
    if wanted:
        there = q.copy()
        for number, name in enumerate(template.coordinates):
            there[number] = places[name].value if name in places else q[number]
        points = 2 * len(records.pairs) + 2 * len(template.coordinates) + 2 * len(records.measures)
        found, _, _ = _replay(
            records, there[None], np.zeros((1, points), np.int64), np.zeros((1, points, 2)),
            np.zeros((1, len(template.bodies))),
        )  # fmt: skip
        pose[wanted] = found[0, wanted]
    return pose


def _forces(data: xarray.Dataset, time: NDArray[np.float64]) -> tuple[NDArray[np.float64], str]:
    """Force (frames, points, 2) in normal and tangent, and the name of this quantity."""
    if "contact_force" in data:
        return data["contact_force"].to_numpy(), "normal force"
    shape = (*data["mode"].shape, 2)
    if "contact_impulse" not in data:
        return np.zeros(shape), ""
    since = np.diff(time, prepend=-np.inf)
    impulse = data["contact_impulse"].to_numpy()
    return impulse / np.where(since > 0.0, since, np.inf)[:, None, None], "mean normal force"


def _pushes(records: Records, force: NDArray[np.float64]) -> NDArray[np.float64]:
    total = np.zeros((len(force), len(records.contacts)))
    for p, contact in enumerate(records.pairs["contact"]):
        total[:, contact] += force[:, 2 * p : 2 * p + 2, 0].sum(axis=1)
    return total


def _outlines(records: Records) -> tuple[Outline, ...]:
    found = []
    for shape in records.shapes:
        halfplane = bool(shape["kind"] == HALFPLANE)
        first = int(shape["first"])
        v = records.vertices[first : first + 1 if halfplane else int(shape["end"])]
        found.append(
            Outline(
                body=int(shape["body"]),
                vertices=np.column_stack([v["x"], v["y"]]),
                normals=np.column_stack([v["normal_x"], v["normal_y"]]),
                radius=float(shape["radius"]),
                halfplane=halfplane,
            )
        )
    return tuple(found)


def _replay(
    records: Records, q: NDArray[np.float64], mode: NDArray[np.int64], force: NDArray[np.float64],
    raised: NDArray[np.float64],
) -> tuple[NDArray[np.float64], Touches, NDArray[np.float64]]:  # fmt: skip
    """Poses, contact points and gaps of each frame, by the kernels of the planar system."""
    count, slots = len(q), 2 * len(records.pairs)
    if len(records.pairs) <= EXACT:
        records.contacts["watched"] = 1
    placed, manifolds = allocate_placement(records), contact_manifold.allocate_manifolds(records)
    points, features = manifolds.points, manifolds.features
    seams, course = allocate_seams(records), allocate_course(records)
    reach = records.shapes["reach"]
    margin = NEAR * float(reach[np.isfinite(reach)].max(initial=0.0))
    contact_of = np.repeat(records.pairs["contact"], 2)
    pose = np.zeros((count, len(records.bodies), 3))
    gap = np.zeros((count, len(records.contacts)))
    rows: list[tuple[NDArray[Any], ...]] = []
    lifts, (a, b) = records.contacts["lifts"] != 0, (records.contacts[f"body_{side}"] for side in "ab")
    for k in range(count):
        records.contacts["raised"] = lifts * np.maximum(raised[k, a], raised[k, b])
        place(records, q[k], placed, k == 0)
        pose[k, :, 0], pose[k, :, 1] = placed.pose[:, X], placed.pose[:, Y]
        if k == 0 or len(seams.neighbours) > seams.still[0]:
            find_seams(records, placed, seams)
        find_contacts(records, placed, q[k], margin, manifolds, seams, course)
        gap[k] = manifolds.gaps
        active = (mode[k, :slots] != OPEN) | (force[k, :slots, 0] > 0.0)
        at = np.flatnonzero(
            (features != contact_manifold.ABSENT) & (active | (points[:, contact_manifold.GAP] <= margin))
        )
        nx, ny = points[at, contact_manifold.NORMAL_X], points[at, contact_manifold.NORMAL_Y]
        along, across = force[k, at].T
        world = np.column_stack([along * nx + across * ny, along * ny - across * nx])
        spot = points[at][:, [contact_manifold.POINT_X, contact_manifold.POINT_Y]]
        rows.append((np.full(len(at), k), contact_of[at], spot, world, _SHOWN[mode[k, at]]))
    pose[:, :, 2] = _angles(records, q)
    return pose, Touches(*(np.concatenate(column) for column in zip(*rows, strict=True))), gap


def _angles(records: Records, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles (frames, bodies) with whole turns counted, so that an angle between two frames lies between
    theirs."""
    angles = np.tile(records.bodies["angle"], (len(q), 1))
    for b, body in enumerate(records.bodies):
        first = int(body["coordinate"])
        if body["motion"] == HINGE:
            angles[:, b] += q[:, first]
        elif body["motion"] == FREE:
            angles[:, b] = q[:, first + 2]
    return angles
