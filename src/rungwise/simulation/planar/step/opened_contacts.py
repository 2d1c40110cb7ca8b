"""Contacts that carried load in a step and are wide open after it: the step was far too long.

A step takes faces as flat and directions as constant. A body that turns, rolls or is pushed aside in one step
by more than a part of its own size ends where no motion would have left it, with every gap and residual
right.
"""

from __future__ import annotations

import math

from rungwise.kernel import Ints, Reals, inner_kernel, rare_kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.system.planar.contact_manifold import ABSENT, VERTICES
from rungwise.system.planar.edges import height

STRAY = 0.1
"""Gap at the end of a step, over the smallest shape's reach, of contacts that carried load in it, from which
on the step was too long. Chosen by trial."""


@inner_kernel
def note_opened(records: Records, h: float, contacts: int, workspace: Workspace) -> None:
    """Remember the widest gap of a contact that carried load, after a step of length h."""
    clock, terms, before = workspace.state.clock[0], workspace.terms, workspace.before.features
    for k in range(contacts):
        slot = workspace.scratch.slots[k]
        carried = workspace.scratch.contact_force[2 * k] > 0.0 and terms.restitution[k] == 0.0
        if carried and slot < before.shape[0] and before[slot] != ABSENT:
            gap = _gap(slot, before, records, workspace.state.placed.outline)
            if gap > max(clock.stray, STRAY * clock.smallest):
                clock.stray, clock.stray_time, clock.stray_step = gap, clock.time, h


@rare_kernel
def _gap(slot: int, features: Ints, records: Records, outline: Reals) -> float:
    """Where the bodies are now, the gap between what the slot's feature names: a vertex and the line of an
    edge, or two vertices."""
    pair, shapes = records.pairs[slot // 2], records.shapes
    gap: float = -shapes[pair.shape_a].radius - shapes[pair.shape_b].radius
    edge, vertex = features[slot] // VERTICES, features[slot] % VERTICES
    if edge < VERTICES:
        return gap + height(edge, vertex, outline)
    other = edge - VERTICES
    return gap + math.hypot(outline[vertex, 0] - outline[other, 0], outline[vertex, 1] - outline[other, 1])
