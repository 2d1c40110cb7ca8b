"""Which contacts hold a body at the end of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.keywords import keywords
from rungwise.plain import brief
from rungwise.simulation.options import ModelError
from rungwise.simulation.result import Run
from rungwise.system.planar.contact_manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
from rungwise.wording import choices


@dataclass(frozen=True, eq=False)
class Touching(ByContent):
    """Contacts of one body: `points` (k, 2), `normals` into the body (k, 2), `friction` (k,), and the
    `others`, the bodies that touch it, by name."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    friction: NDArray[np.float64]
    others: tuple[str, ...]

    __repr__ = brief


@keywords
def touching(run: Run, body: str, within: float | None = None) -> Touching:
    """Contacts of `body` when `run` ended, with a gap of at most `within` (by default the scene's tolerance).

    Raises ValueError for an unknown body, or a run that did not begin; ModelError for one that is not planar.
    """
    if not isinstance(run, Run):
        raise ModelError("run: is not planar; contacts at the end are available for planar runs only")
    names = run.scene.template.bodies
    if body not in names:
        raise ValueError(f"body: unknown {body!r}{choices(body, names)}")
    workspace = run.workspace
    if workspace is None:
        raise ValueError(f"the run did not begin: {run.reason}")
    state, records = workspace.state, run.scene.bind(run.parameters).records
    limit = float(records.world[0]["tolerance"]) if within is None else within
    me = names.index(body)
    points, normals, friction, others = [], [], [], []
    for p, pair in enumerate(records.pairs):
        contact = records.contacts[pair["contact"]]
        bodies = int(contact["body_a"]), int(contact["body_b"])
        for slot in (2 * p, 2 * p + 1):
            point = state.manifolds.points[slot]
            if me in bodies and state.manifolds.features[slot] != ABSENT and point[GAP] <= limit:
                # The normal points from b to a.
                sign = 1.0 if bodies[0] == me else -1.0
                points.append(point[[POINT_X, POINT_Y]])
                normals.append(sign * point[[NORMAL_X, NORMAL_Y]])
                friction.append(float(contact["friction"]))
                others.append(names[bodies[1] if bodies[0] == me else bodies[0]])
    shape = (len(points), 2)
    return Touching(
        np.array(points).reshape(shape), np.array(normals).reshape(shape), np.array(friction), tuple(others)
    )
