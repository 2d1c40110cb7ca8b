"""A solved step is taken over: forces, deformations, work, impulses, velocities at its end, and time."""

from __future__ import annotations

import math

from rungwise.contact.step import OPEN, span, stretch
from rungwise.kernel import Ints, Reals, inner_kernel, kernel, summing_kernel
from rungwise.models.assemble import deform
from rungwise.simulation.core.state import Scratch, State, Trial
from rungwise.system.entries import Entries, is_crowded
from rungwise.system.skew import is_skew, squeezed, widened
from rungwise.system.terms import DRIVE, SUPPORT, Terms


@inner_kernel
def end_velocity(theta: float, v_old: float, v_new: float, prescribed: bool) -> float:
    """Velocity at the end of a step, where `v_new` is the velocity at theta (a prescribed one is
    constant)."""
    return v_new if prescribed else (v_new - (1.0 - theta) * v_old) / theta


@kernel
def accept(trial: Trial) -> float:
    """Take over the solved step: forces, deformations, work, impulses, velocities at its end, and time.

    Returns the greatest normal deformation."""
    h, contacts, state, scratch = trial.h, trial.contacts, trial.state, trial.scratch
    clock, deepest = state.clock[0], 0.0
    state.force[:, :] = 0.0
    accept_forces(trial)
    account(trial)
    for i in range(state.v.shape[0]):
        state.v[i] = end_velocity(clock.theta, state.v[i], scratch.v_new[i], state.prescribed[i] == 1)
    for k in range(contacts):
        slot = scratch.slots[k]
        deepest = max(deepest, abs(state.deformation[slot, 0]))
        for i in range(state.force.shape[1]):
            state.impulse[slot, i] += h * state.force[slot, i]
    clock.time += h
    clock.steps += 1
    return deepest


@kernel
def take_slots(
    slots: Ints, fresh: Ints, compliant: bool, state: State, terms: Terms, scratch: Scratch
) -> None:
    """Let the contacts of a step be those of these slots, as deformed as they are. Slots whose features are
    new have no force, and are deformed by as much as bodies that yield overlap there already: other features
    of theirs have held them. Dampers would otherwise stop what has long come to rest."""
    d = state.force.shape[1]
    for k in range(slots.shape[0]):
        slot = scratch.slots[k] = slots[k]
        if fresh[k]:
            state.modes[slot] = OPEN
            for i in range(d):
                state.force[slot, i] = state.deformation[slot, i] = 0.0
            if compliant and math.isfinite(terms.contact_stiffness[k, 0, 0]):
                state.deformation[slot, 0] = max(0.0, -terms.gap[k])
        for i in range(d):
            terms.deformation[k * d + i] = state.deformation[slot, i]
        if is_skew(terms.skew):
            x, y = state.deformation[slot, 1], state.deformation[slot, 2]
            terms.deformation[k * d + 1], terms.deformation[k * d + 2] = squeezed(terms.skew, k, x, y)


@kernel
def accept_forces(trial: Trial) -> None:
    """Hand forces, modes and deformations of the solved contacts to their slots, whose forces are zero."""
    rung, _, terms, contacts, state, scratch, _ = trial
    force, slots = scratch.contact_force, scratch.slots
    d = state.force.shape[1]
    if rung[0].compliant:
        _relax(trial)
    for k in range(contacts):
        slot = slots[k]
        state.modes[slot] = scratch.mode[k]
        for i in range(d):
            state.force[slot, i] = terms.lever[k] * force[k * d + i]
        if is_skew(terms.skew):
            x, y = force[k * d + 1], force[k * d + 2]
            state.force[slot, 1], state.force[slot, 2] = squeezed(terms.skew, k, x, y)
    for r in range(state.clock[0].limited):
        scratch.limited_mode[r] = scratch.mode[contacts + r]


@kernel
def _relax(trial: Trial) -> None:
    """Fill in new deformations. A slot that is too far away to be among the contacts is at rest."""
    _, h, terms, contacts, state, scratch, problem = trial
    for k in range(contacts):
        if math.isfinite(terms.contact_stiffness[k, 0, 0]):
            deform(h, state.clock[0].theta, terms, k, scratch.contact_force, problem, scratch.after)
            if is_skew(terms.skew):
                x, y = scratch.after[1], scratch.after[2]
                scratch.after[1], scratch.after[2] = widened(terms.skew, k, x, y)
            for i in range(scratch.after.shape[0]):
                state.deformation[scratch.slots[k], i] = scratch.after[i]


@kernel
def account(trial: Trial) -> None:
    """Add reactions of drives, and the work of drives, loads, contacts and supports over the step.

    With the mean of the velocities at both ends as lever, their sum is the change of kinetic energy to
    rounding. On the kinematic rung there is neither force nor work.
    """
    rung, h, terms, contacts, state, scratch, _ = trial
    if rung[0].metric:
        return
    clock = state.clock[0]
    n, d, theta = state.v.shape[0], state.force.shape[1], clock.theta
    momentum = rung[0].inertia > 0.0
    _push(terms, contacts * d, scratch.contact_force, state.reaction)
    for i in range(n):
        contact = state.reaction[i]
        limited, support, joint = 0.0, 0.0, 0.0
        for r in range(clock.limited):
            force = terms.limited[r, i] * scratch.limited_force[r]
            if terms.account[r] == DRIVE:
                limited += force
            elif terms.account[r] == SUPPORT:
                support += force
            else:
                joint += force
        elastic = -theta * h * _row_product(terms.entries, terms.stiffness, i, scratch.v_new)
        support -= _row_product(terms.entries, terms.damping, i, scratch.v_new)
        drive = terms.load[i] - state.passive[i] + elastic + limited
        if state.prescribed[i]:
            inertial = 0.0
            low, high = stretch(terms.entries.matrices, i, n)
            for j in range(low, high if momentum else low):
                end = end_velocity(theta, state.v[j], scratch.v_new[j], state.prescribed[j])
                inertial += clock.eps * terms.inertia[i, j - low] * (end - state.v[j]) / h
            drive = inertial - state.passive[i] - contact - support - joint
        lever = scratch.v_new[i]
        if momentum:
            end = end_velocity(theta, state.v[i], scratch.v_new[i], state.prescribed[i])
            lever = 0.5 * (state.v[i] + end)
        state.reaction[i] = drive
        clock.drive_work += h * lever * drive
        clock.load_work += h * lever * state.passive[i]
        clock.contact_work += h * lever * contact
        clock.support_work += h * lever * support
        clock.joint_work += h * lever * joint


@kernel
def _push(terms: Terms, rows: int, force: Reals, push: Reals) -> None:
    """Write what forces along the first rows do to each coordinate into `push` (n,)."""
    push[:] = 0.0
    d, n = terms.contact_stiffness.shape[1], push.shape[0]
    for r in range(rows):
        for side in range(2 if force[r] != 0.0 else 0):
            first, end, shift = span(terms.entries.rows, r // d, side, n)
            for i in range(first, end):
                push[i] += terms.rows[r, i - shift] * force[r]


@inner_kernel
def _row_product(entries: Entries, matrix: Reals, i: int, v: Reals) -> float:
    if not is_crowded(entries):
        return _product(matrix[i], v)
    total = 0.0
    for j in range(entries.matrices[i, 0], entries.matrices[i, 1]):
        total += matrix[i, j - entries.matrices[i, 0]] * v[j]
    return total


@summing_kernel
def _product(row: Reals, v: Reals) -> float:
    total = 0.0
    for i in range(len(row)):
        total += row[i] * v[i]
    return total


@kernel
def fill_pace(v: Reals, speed: Reals, fall: Reals, h: float, pace: Reals) -> None:
    """How fast coordinates (n,) may be within a step: as they are, as they are driven, and as they fall."""
    for i in range(len(pace)):
        pace[i] = max(abs(v[i]), abs(speed[i])) + h * abs(fall[i])
