"""A step linearised again about its trial end, where its contacts are not as they were at its start."""

from __future__ import annotations

from rungwise.contact.step import span
from rungwise.kernel import RecordArray, copy, rare_kernel
from rungwise.scene.fields.laws.contact import PULLS
from rungwise.scene.template.records import Records
from rungwise.simulation.planar.state.nearby import attract, gather, join
from rungwise.simulation.planar.state.workspace import Scratch, Workspace
from rungwise.simulation.planar.step.midpoint_rows import take_means
from rungwise.system.planar import terms as planar
from rungwise.system.planar.contact_manifold import GAP
from rungwise.system.terms import Terms


@rare_kernel
def restart(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> None:
    """Fill in rows of joints and loads at the start again."""
    copy(workspace.early.load, workspace.terms.load)
    if workspace.state.clock[0].centred:
        copy(workspace.early.passive, workspace.state.passive)
    if records.joints.shape[0] > 0:
        join(records, rung, workspace, h)


@rare_kernel
def linearise(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> int:
    """Linearise the step about its trial end, with the rows there or, if it is centred, with their means with
    those at the start; returns how many contacts there are. Nothing bounced at the start, so nothing does."""
    state, terms = workspace.state, workspace.terms
    clock = state.clock[0]
    centred = clock.centred and not clock.lost
    if centred and rung[0].loads:
        planar.loads(
            records, state.placed.pose, state.q, state.v, state.start, clock.time, h, rung[0].theta,
            state.passive, terms,
        )  # fmt: skip
        if clock.laws & PULLS:
            attract(records, workspace)
    else:
        copy(workspace.early.load, terms.load)
    contacts = gather(records, workspace)
    if records.joints.shape[0] > 0:
        join(records, rung, workspace, h)
    if centred:
        take_means(contacts, workspace)
    for k in range(contacts):
        terms.restitution[k] = 0.0
    _shift(h, contacts, clock.drives, clock.limited, terms, workspace.scratch)
    return contacts


@rare_kernel
def _shift(h: float, contacts: int, drives: int, limited: int, terms: Terms, scratch: Scratch) -> None:
    """Linearise about the trial state: gaps and errors of joints less the contribution of the trial
    velocity."""
    for r in range(drives, limited):
        for j in range(scratch.v_new.shape[0]):
            terms.error[r, 0] += h * terms.limited[r, j] * scratch.v_new[j]
    for k in range(contacts):
        for side in range(2):
            first, end, shift = span(terms.entries.rows, k, side, scratch.v_new.shape[0])
            for j in range(first, end):
                terms.gap[k] -= h * terms.rows[2 * k, j - shift] * scratch.v_new[j]


@rare_kernel
def take_back(h: float, contacts: int, workspace: Workspace) -> bool:
    """Let contacts that push take back in the step, with the rows of its start, the overlap that their bodies
    add by turning on the way to the trial end; returns whether any does.

    With these rows the bodies part as fast as they approached, so the impulse does no work; with the rows of
    the trial end it would brake what slides, by more the longer the step.
    """
    state, terms, scratch = workspace.state, workspace.terms, workspace.scratch
    features, added = state.manifolds.features, False
    longer = max(1.0, terms.pause[0] / h)
    for k in range(contacts):
        slot, gap = scratch.slots[k], terms.gap[k]
        same = slot < features.shape[0] and features[slot] == workspace.before.features[slot]
        if same and scratch.contact_force[2 * k] > 0.0:
            for side in range(2):
                first, end, shift = span(terms.entries.rows, k, side, scratch.v_new.shape[0])
                for j in range(first, end):
                    gap += h * terms.rows[2 * k, j - shift] * scratch.v_new[j]
            turned = gap - state.manifolds.points[slot, GAP]
            if turned > terms.rounding[0]:
                left = max(terms.gap[k], 0.0) - turned
                terms.gap[k] = left if left >= 0.0 else min(terms.gap[k], 0.0) + longer * left
                added = True
        terms.restitution[k] = 0.0
    return added
