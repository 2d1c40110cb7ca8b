"""The last resort of a step that the compiled chain does not solve, however short: `rw.solve` and its
proofs, or else words."""

from __future__ import annotations

import numpy as np

from rungwise.contact.judge import Certificate
from rungwise.contact.step import OPEN, STICK, TOLERANCE, ContactProblem, keep_contacts
from rungwise.deadline import Deadline
from rungwise.models.entries import trimmed
from rungwise.simulation.core.limit_surface import in_boxes
from rungwise.simulation.core.state import Scratch, State, Trial
from rungwise.system.terms import Terms, normals_of, whole

RAN_AWAY = (
    "speeds have grown beyond all numbers: inertial forces of joined bodies, taken where a step begins,"
    " add energy where the bodies turn far in it"
)
"""What a run lacks whose speeds have grown without bound."""


def ask(
    problem: ContactProblem, terms: Terms, state: State, scratch: Scratch, deadline: Deadline
) -> tuple[Certificate | None, bool]:
    """The checked certificate that a step's problem has no solution, if there is one; and whether `rw.solve`
    solves it: then its forces become the forces to start from. Raises TimeOver."""
    # Few runs need it, and it takes long to import.
    from rungwise.contact.certify import certify_or_solve
    from rungwise.contact.solution import Status

    certificate, answer = certify_or_solve(problem, deadline)
    if answer is None or answer.status != Status.SOLVED:
        return certificate, False
    for k, force in enumerate(answer.r.reshape(-1, problem.R.shape[1])):
        slot = scratch.slots[k]
        state.modes[slot] = STICK if force[0] > 0.0 else OPEN
        state.force[slot] = terms.lever[k] * force
    scratch.limited_force[: len(answer.z)] = answer.z
    return None, True


def unsupported(trial: Trial, near: float, deadline: Deadline) -> Certificate | None:
    """A checked proof that nothing balances the loads in the step just tried, by the contacts that have to:
    those that are closer than `near`, pushed in the last step, or are closed by driven motion. Raises
    TimeOver."""
    from rungwise.contact.certify import certify_unsupported

    terms, contacts, state = trial.terms, trial.contacts, trial.state
    clock = state.clock[0]
    free = state.free[: int(clock["free"])]
    grid = np.ix_(free, free)
    stiff, damping = whole(terms, terms.stiffness)[grid], whole(terms, terms.damping)[grid]
    resisting = float(clock["theta"]) * trial.h * stiff + damping
    moved = -trial.h * (normals_of(terms, contacts) @ state.speed)
    pushed = state.modes[trial.scratch.slots[:contacts]] != OPEN
    held = (terms.gap[:contacts] <= np.maximum(near, moved)) | pushed
    problem = trimmed(trial.problem, terms, len(free), contacts, int(clock["limited"]))
    problem = in_boxes(problem, terms, trial.scratch.limited_force)
    return certify_unsupported(keep_contacts(problem, held), resisting, deadline)


def lacking(unsupported: bool, overlaps: bool, residual: float) -> str:
    """What an attempt lacks, however short, that has no proof, as a clause: support, room, or a solution."""
    if unsupported:
        return "forces do not balance without inertia, and no certificate says why"
    if overlaps:
        return "bodies overlap after each step, however short: their contacts change more than they move"
    if residual <= TOLERANCE:
        return "only forces far beyond all that loads call for solve the step"
    return f"no step, however short, has a solution, and no certificate says why (residual {residual:.1e})"
