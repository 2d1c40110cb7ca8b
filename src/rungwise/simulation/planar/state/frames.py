"""Recording into preallocated buffers."""

from __future__ import annotations

import math

from rungwise.contact.step import stretch
from rungwise.kernel import Reals, RecordArray, copy, kernel, rare_kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.planar.state.ways import set_ways
from rungwise.simulation.planar.state.workspace import Frames, Workspace
from rungwise.system.planar import joints
from rungwise.system.planar.near import near_pairs, pair_at
from rungwise.system.planar.terms import potential_energy


@kernel
def record(records: Records, rung: RecordArray, workspace: Workspace, always: bool) -> None:
    """Keep the present state if its turn has come, or `always`; thin a full buffer and double the stride."""
    state, frames = workspace.state, workspace.frames
    clock = state.clock[0]
    clock.since += 1
    if not always and clock.since < clock.stride:
        return
    if clock.frames == frames.memory.shape[0]:
        if clock.frames % 2 == 0:
            for slot in range(state.impulse.shape[0]):
                for i in range(state.impulse.shape[1]):
                    state.impulse[slot, i] += frames.impulse[clock.frames - 1, slot, i]
        _thin(frames)
        clock.frames = (clock.frames + 1) // 2
        clock.stride *= 2
    k = clock.frames
    set_ways(records, state)
    copy(state.memory, frames.memory[k])
    copy(state.impulse, frames.impulse[k])
    copy(state.reaction, frames.reaction[k])
    if records.joints.shape[0] > 0:
        scratch = workspace.scratch
        joints.values(records, state.placed.pose, state.q, scratch.row, frames.joint[k])
        joints.forces(records, rung[0].metric, clock.drives, scratch.limited_force, frames.joint_force[k])
    _scalars(records, rung, workspace, frames.scalars[k])
    state.impulse[:, :] = 0.0
    clock.frames += 1
    clock.since = 0


@rare_kernel
def _thin(frames: Frames) -> None:
    """Drop every other frame; impulses of a dropped frame go to the next one kept."""
    count = frames.memory.shape[0]
    for k in range(2, count, 2):
        for slot in range(frames.impulse.shape[1]):
            for i in range(frames.impulse.shape[2]):
                frames.impulse[k, slot, i] += frames.impulse[k - 1, slot, i]
    for k in range(1, (count + 1) // 2):
        copy(frames.memory[2 * k], frames.memory[k])
        copy(frames.impulse[2 * k], frames.impulse[k])
        copy(frames.reaction[2 * k], frames.reaction[k])
        copy(frames.joint[2 * k], frames.joint[k])
        copy(frames.joint_force[2 * k], frames.joint_force[k])
        copy(frames.scalars[2 * k], frames.scalars[k])


@kernel
def _scalars(records: Records, rung: RecordArray, workspace: Workspace, out: Reals) -> None:
    """Residual, energies and work, in the order of `workspace.SCALARS`."""
    state, terms, frames = workspace.state, workspace.terms, workspace.frames
    clock = state.clock[0]
    kinetic = 0.0
    for i in range(state.v.shape[0]):
        first, end = stretch(terms.entries.matrices, i, state.v.shape[0])
        for j in range(first, end):
            kinetic += 0.5 * rung[0].inertia * terms.inertia[i, j - first] * state.v[i] * state.v[j]
    elastic = 0.0
    if rung[0].compliant:
        for i in range(near_pairs(state.manifolds, records.pairs.shape[0])):
            p = pair_at(state.manifolds, i)
            contact = records.contacts[records.pairs[p].contact]
            for slot in range(2 * p, 2 * p + 2):
                normal, tangent = state.deformation[slot, 0], state.deformation[slot, 1]
                elastic += 0.5 * (contact.stiffness * normal**2 + contact.tangential_stiffness * tangent**2)
                elastic += contact.coupling_stiffness * normal * tangent
    for m in range(records.measures.shape[0]):
        if records.measures[m].held and math.isfinite(records.measures[m].stiffness):
            elastic += 0.5 * records.measures[m].stiffness * frames.joint[clock.frames, m] ** 2
    out[0] = clock.residual
    out[1] = kinetic
    out[2] = potential_energy(records, state.placed.pose)
    out[3] = elastic
    out[4] = clock.drive_work
    out[5] = clock.load_work
    out[6] = clock.contact_work
    out[7] = clock.support_work
    out[8] = clock.joint_work
