"""Planar runs that are told their inputs step by step: schedules that grow, and contacts as they are seen."""

from __future__ import annotations

import numpy as np

from rungwise.contact.step import NAMES, OPEN, STICK
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.template.records import Records
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.system.planar.contact_manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y


def contacts_of(
    scene: Scene, model: Rung, records: Records, tolerance: float, workspace: Workspace
) -> Contacts:
    """Contacts of a planar run that are closed, within the scene's tolerance, or push."""
    state, template = workspace.state, scene.template
    points, count = state.manifolds.points, len(state.manifolds.features)
    force = state.force[:count]
    closed = (points[:, GAP] <= tolerance) | (force[:, 0] > 0.0)
    slots = np.flatnonzero((state.manifolds.features != ABSENT) & closed)
    # The normal of a slot points into the first body, and its force acts on that.
    normals = -points[slots][:, [NORMAL_X, NORMAL_Y]]
    along, across = force[slots].T if model.loads else np.full((2, len(slots)), np.nan)
    tangents = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    pairs = records.pairs["contact"][slots // 2]
    modes = state.modes[slots]
    return Contacts(
        bodies=tuple(template.contacts[int(pair)] for pair in pairs),
        points=points[slots][:, [POINT_X, POINT_Y]],
        normals=normals,
        forces=along[:, None] * normals + across[:, None] * tangents,
        pushes=np.array(along),
        gaps=points[slots, GAP],
        modes=tuple(NAMES[mode] if mode in (OPEN, STICK) else "slip" for mode in modes),
    )
