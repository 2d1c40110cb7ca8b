"""Keeping a state, restoring it when a step is not accepted, and emptying the workspace for the next run."""

from __future__ import annotations

from rungwise.kernel import Reals, RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.core.tolerances import ROUNDING
from rungwise.simulation.planar.state.nearby import look
from rungwise.simulation.planar.state.workspace import Snapshot, State, Workspace
from rungwise.simulation.watched.verdicts import RUNNING
from rungwise.system.planar.contact_manifold import ABSENT, UNKNOWN
from rungwise.system.planar.near import is_listed
from rungwise.system.planar.place import place
from rungwise.system.terms import APART


@kernel
def keep(workspace: Workspace, kept: Snapshot) -> None:
    """Keep the state; `restore` brings back the one in `workspace.kept`."""
    copy(workspace.state.memory, kept.memory)
    copy(workspace.state.impulse, kept.impulse)
    kept.turn[0] = workspace.state.manifolds.turn[0]


@kernel
def restore(records: Records, workspace: Workspace) -> None:
    """Restore the kept state, but for the counts of attempts and of problems solved, and for votes on what
    keeps steps short."""
    state, kept = workspace.state, workspace.kept
    clock = state.clock[0]
    attempts, solves, crowd = clock.attempts, clock.solves, clock.crowd
    blamed, votes, refusal = clock.blamed, clock.votes, clock.refusal
    state.clock[0] = kept.clock[0]
    clock.attempts, clock.solves, clock.crowd = attempts, solves, crowd
    clock.blamed, clock.votes, clock.refusal = blamed, votes, refusal
    copy(kept.v, state.v)
    copy(kept.force, state.force)
    copy(kept.impulse, state.impulse)
    copy(kept.impulses, state.impulses)
    copy(kept.dates, state.dates)
    copy(kept.recent, state.recent)
    copy(kept.limited_mode, workspace.scratch.limited_mode)
    bring_back(records, workspace, kept)
    state.clock[0].least_gap = kept.clock[0].least_gap
    state.manifolds.heard[0] = 0


@inner_kernel
def remember(state: State, saved: Snapshot) -> None:
    """Save coordinates, and contacts and deformations, where they may have changed since they were saved."""
    manifolds = state.manifolds
    for i in range(state.q.shape[0]):
        saved.q[i] = state.q[i]
    if is_listed(manifolds) and saved.turn[0] == manifolds.turn[0]:
        _remember_near(state, saved)
        return
    for slot in range(manifolds.features.shape[0]):
        _remember(slot, state, saved)
    if is_listed(manifolds):
        saved.turn[0] = manifolds.turn[0]


@rare_kernel
def _remember_near(state: State, saved: Snapshot) -> None:
    """Save what belongs to pairs that are listed."""
    manifolds = state.manifolds
    for i in range(manifolds.listed[0]):
        _remember(2 * manifolds.near[i], state, saved)
        _remember(2 * manifolds.near[i] + 1, state, saved)


@inner_kernel
def _remember(slot: int, state: State, saved: Snapshot) -> None:
    saved.features[slot] = state.manifolds.features[slot]
    saved.modes[slot] = state.modes[slot]
    for i in range(state.deformation.shape[1]):
        saved.deformation[slot, i] = state.deformation[slot, i]


@kernel
def bring_back(records: Records, workspace: Workspace, saved: Snapshot) -> None:
    """Restore saved coordinates, contacts and deformations; contacts that came into view since then stay in
    view."""
    state = workspace.state
    manifolds = state.manifolds
    for i in range(state.q.shape[0]):
        state.q[i] = saved.q[i]
    if is_listed(manifolds) and saved.turn[0] == manifolds.turn[0]:
        for i in range(manifolds.listed[0]):
            _bring_back(2 * manifolds.near[i], state, saved)
            _bring_back(2 * manifolds.near[i] + 1, state, saved)
    else:
        for slot in range(manifolds.features.shape[0]):
            _bring_back(slot, state, saved)
        manifolds.turn[0] += 1
    place(records, state.q, state.placed, False)
    look(records, workspace, state.v)


@inner_kernel
def _bring_back(slot: int, state: State, saved: Snapshot) -> None:
    state.manifolds.features[slot] = saved.features[slot]
    state.modes[slot] = saved.modes[slot]
    for i in range(state.deformation.shape[1]):
        state.deformation[slot, i] = saved.deformation[slot, i]


@kernel
def go_on(records: Records, workspace: Workspace, memory: Reals) -> None:
    """Go on from the memory of an accepted step of the same scene, rung and parameters, in a workspace that
    was prepared; steps count from here, and are taken as this run's options say."""
    state, centred = workspace.state, workspace.state.clock[0].centred
    copy(memory, state.memory)
    state.manifolds.within[0] = UNKNOWN
    place(records, state.q, state.placed, False)
    look(records, workspace, state.v)
    copy(memory, state.memory)
    state.manifolds.turn[0] += 1
    clock = state.clock[0]
    clock.centred = centred
    workspace.terms.rounding[0] = ROUNDING * clock.extent
    clock.steps = clock.attempts = clock.solves = clock.frames = clock.since = 0
    clock.outcome = RUNNING
    clock.worst_residual = 0.0


@kernel
def clear(workspace: Workspace, blank: RecordArray) -> None:
    """Reset the workspace, but for frames and arrays that every step fills anew; `blank` is a zero clock."""
    state, terms = workspace.state, workspace.terms
    state.clock[0] = blank[0]
    state.manifolds.gaps[:] = 0.0
    state.manifolds.lifted[:] = 0
    state.pushes[:] = 0.0
    state.impulses[:] = 0.0
    state.recent[:, :] = 0.0
    state.speed[:] = 0.0
    state.passive[:] = 0.0
    state.reaction[:] = 0.0
    state.manifolds.features[:] = ABSENT
    state.manifolds.within[0] = UNKNOWN
    state.manifolds.turn[0] += 1
    state.modes[:] = 0
    state.deformation[:, :] = 0.0
    state.force[:, :] = 0.0
    state.impulse[:, :] = 0.0
    workspace.scratch.limited_mode[:] = 1
    workspace.watched.undefined[0] = -1
    terms.inertia[:, :] = 0.0
    terms.metric[:, :] = 0.0
    terms.stiffness[:, :] = 0.0
    terms.damping[:, :] = 0.0
    terms.heft[:, :] = 0.0
    terms.load[:] = 0.0
    terms.fall[:] = 0.0
    terms.limited[:, :] = 0.0
    terms.limit[:] = 0.0
    terms.gains[:, :] = 0.0
    terms.error[:, :] = 0.0
    terms.account[:] = 0
    terms.surface[:] = APART
