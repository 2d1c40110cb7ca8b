"""Trajectories of joints with times, as tables and as messages, for what executes them."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from rungwise.content import ByContent
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.plain import brief
from rungwise.scene.fields.values import shown
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.options import positive
from rungwise.stored import whole
from rungwise.wording import choices, listed
from rungwise.world.contract import ROBOT
from rungwise.world.find import world_of
from rungwise.world.parts import ExportError

SUFFIXES = (".csv", ".json")


@dataclass(frozen=True, eq=False)
class JointTrajectory(ByContent):
    """Positions of the joints (k) of a run at times (m).

    names: coordinates of the scene; joints: what the model calls them, in the plane the same; time (m,):
    since the first; position, velocity (m, k): in the scene's units, angles in radians; effort (m, k): forces
    and torques of drives, None where the rung has none.
    """

    names: tuple[str, ...]
    joints: tuple[str, ...]
    time: Reals
    position: Reals
    velocity: Reals
    effort: Reals | None

    __repr__ = brief

    def csv(self) -> str:
        """A table: time, then for each joint its place, its velocity and, where known, the force of its
        drive. Numbers are written in full."""
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        parts = {"": self.position, ".velocity": self.velocity}
        if self.effort is not None:
            parts[".effort"] = self.effort
        writer.writerow(["time", *(name + ending for ending in parts for name in self.joints)])
        for row in np.column_stack([self.time, *parts.values()]).tolist():
            writer.writerow(map(repr, row))
        return text.getvalue()

    def message(self) -> dict[str, Any]:
        """As plain values with the fields of trajectory_msgs/JointTrajectory of ROS 2."""
        points = []
        for k, time in enumerate(self.time.tolist()):
            sec, nanosec = divmod(round(time * 1e9), 1_000_000_000)
            point: dict[str, Any] = {
                "positions": self.position[k].tolist(),
                "velocities": self.velocity[k].tolist(),
                "accelerations": [],
                "effort": [] if self.effort is None else self.effort[k].tolist(),
                "time_from_start": {"sec": sec, "nanosec": nanosec},
            }
            points.append(point)
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
        return {"header": header, "joint_names": list(self.joints), "points": points}

    @keywords
    def save(self, file: str | Path) -> Path:
        """Write the table (.csv) or the message (.json) to `file`, whole or not at all. Raises ExportError
        for another ending, and OSError."""
        target = Path(file)
        if target.suffix.lower() not in SUFFIXES:
            raise ExportError(f"file: must end in {listed(SUFFIXES)}, not {shown(target.name)}")
        text = self.csv() if target.suffix.lower() == ".csv" else json.dumps(self.message(), indent=1)
        with whole(target) as draft:
            draft.write_text(text, "utf-8")
        return target


def joint_trajectory(
    run: AnyRun, names: Sequence[str] | None = None, rate: float | None = None
) -> JointTrajectory:
    """The places of a run's joints over time: those of robots, or of the coordinates named; at the frames
    that were recorded, or `rate` times in a unit of time and at the end, between frames linearly.

    Raises ExportError for names that are no joints, or where nothing is driven; ModelError for a rate;
    ValueError for a run that never began.
    """
    run.check_begun()
    world = world_of(run.scene)
    joints = world.joints()
    chosen = _chosen(names, joints, world.roles(run.parameters))
    data = run.trajectory
    frames = data.time.values
    time = frames
    if rate is not None:
        count = int(np.floor((frames[-1] - frames[0]) * positive("rate", rate) * (1.0 + 1e-12)))
        time = np.unique([*(frames[0] + np.arange(count + 1) / rate), frames[-1]])
    taken = {"position": data.position}
    taken["velocity"] = data.velocity
    if "drive_force" in data:
        taken["effort"] = data.drive_force
    found: dict[str, Reals] = {}
    for name, values in taken.items():
        (axis,) = (each for each in values.dims if each != "time")
        known = list(values.coords[axis].values)
        rows = [values.values[:, known.index(each)] for each in chosen]
        found[name] = np.column_stack([np.interp(time, frames, row) for row in rows])
    return JointTrajectory(
        tuple(chosen), tuple(joints[name] for name in chosen), time - time[0], found["position"],
        found["velocity"], found.get("effort"),
    )  # fmt: skip


def _chosen(names: Sequence[str] | None, joints: dict[str, str], roles: dict[str, str]) -> list[str]:
    """Coordinates to tell. Raises ExportError."""
    if names is None:
        found = [name for name in joints if roles.get(name.partition(".")[0]) == ROBOT]
        if not found:
            raise ExportError(f"names: nothing drives a joint in the scene; joints: {listed(joints)}")
        return found
    if isinstance(names, str) or not names:
        raise ExportError(f"names: must be a list of coordinates, not {shown(names)}")
    by_joint = {joint: name for name, joint in joints.items()}
    for name in names:
        if name not in joints and name not in by_joint:
            raise ExportError(f"names: {shown(name)} is no joint{choices(name, joints)}")
    return [name if name in joints else by_joint[name] for name in names]
