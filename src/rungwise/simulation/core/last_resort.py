"""The last resort of a step that the compiled chain does not solve, however short: `rw.solve` and its
proofs, or else words."""

from __future__ import annotations

import numpy as np

from rungwise.contact.judge import Certificate, certify_unsupported, check_in_space
from rungwise.contact.step import OPEN, STICK, TOLERANCE, ContactProblem, keep_contacts, trim
from rungwise.deadline import Deadline
from rungwise.simulation.core.limit_surface import in_boxes
from rungwise.simulation.core.state import Scratch, State, Trial
from rungwise.system.skew import is_skew, squeezed
from rungwise.system.terms import Terms

IN_SPACE = 3
"""Directions of contacts that `rw.solve` and the checker of certificates know; a step may have more, for
torsion and rolling."""
RAN_AWAY = (
    "speeds have grown beyond all numbers: inertial forces of joined bodies, taken where a step begins,"
    " add energy where the bodies turn far in it"
)
"""What a run lacks whose speeds have grown without bound."""


def ask(
    problem: ContactProblem, terms: Terms, state: State, scratch: Scratch, deadline: Deadline
) -> tuple[bool, Certificate | None]:
    """Whether `rw.solve` solves a step's problem, and else the checked certificate of a jam, if there is one.
    The forces of a solution become the forces to start from. A step so short that no numbers scale its
    problem is not solved. Raises TimeOver."""
    # Few runs need it, and it takes long to import.
    from rungwise.contact.problem import BeyondScale
    from rungwise.contact.solution import Status
    from rungwise.contact.solve import solve

    try:
        answer = solve(problem, limit=deadline.seconds)
    except BeyondScale:
        return False, None
    if answer.status == Status.SOLVED:
        for k, force in enumerate(answer.r.reshape(-1, IN_SPACE)):
            slot = scratch.slots[k]
            state.modes[slot] = STICK if force[0] > 0.0 else OPEN
            state.force[slot] = terms.lever[k] * force
            if is_skew(terms.skew):
                state.force[slot, 1:] = squeezed(terms.skew, k, force[1], force[2])
        scratch.limited_force[: len(answer.z)] = answer.z
        return True, None
    deadline.look_in_proof()
    if answer.status != Status.JAMMED or answer.certificate is None:
        return False, None
    found = Certificate("frictional", answer.certificate.vectors, answer.certificate.modes)
    return False, found if check_in_space(problem, found) else None


def unsupported(trial: Trial, near: float, deadline: Deadline) -> Certificate | None:
    """A checked proof that nothing balances the loads in the step just tried, by the contacts that have to:
    those that are closer than `near`, pushed in the last step, or are closed by driven motion. Raises
    TimeOver."""
    terms, contacts, state = trial.terms, trial.contacts, trial.state
    clock, d = state.clock[0], state.force.shape[1]
    free = state.free[: int(clock["free"])]
    grid = np.ix_(free, free)
    resisting = float(clock["theta"]) * trial.h * terms.stiffness[grid] + terms.damping[grid]
    moved = -trial.h * (terms.rows[: contacts * d : d] @ state.speed)
    pushed = state.modes[trial.scratch.slots[:contacts]] != OPEN
    held = (terms.gap[:contacts] <= np.maximum(near, moved)) | pushed
    problem = trim(trial.problem, len(free), contacts, int(clock["limited"]))
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
