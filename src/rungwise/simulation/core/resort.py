"""The last resort of a step that the compiled chain does not solve, however short: `rw.solve` and its
proofs, or else words."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.judge import Certificate, check_in_space
from rungwise.contact.solution import Status
from rungwise.contact.solve import solve
from rungwise.contact.step import OPEN, STICK, TOLERANCE, ContactProblem
from rungwise.deadline import Deadline
from rungwise.kernel import Reals
from rungwise.simulation.core.state import Scratch, State
from rungwise.system.terms import Terms

Bools: TypeAlias = NDArray[np.bool_]
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
    The forces of a solution become the forces to start from. Raises TimeOver."""
    answer = solve(problem, limit=deadline.seconds)
    if answer.status == Status.SOLVED:
        for k, force in enumerate(answer.r.reshape(-1, IN_SPACE)):
            slot = scratch.slots[k]
            state.modes[slot] = STICK if force[0] > 0.0 else OPEN
            state.force[slot] = terms.lever[k] * force
        scratch.limited_force[: len(answer.z)] = answer.z
        return True, None
    deadline.look_in_proof()
    if answer.status != Status.JAMMED or answer.certificate is None:
        return False, None
    found = Certificate("frictional", answer.certificate.vectors, answer.certificate.modes)
    return False, found if check_in_space(problem, found) else None


def resisting(terms: Terms, state: State) -> Reals:
    """H (n, n) of the last problem without its inertia."""
    clock = state.clock[0]
    free = state.free[: int(clock["free"])]
    grid = np.ix_(free, free)
    return np.asarray(float(clock["theta"] * clock["tried"]) * terms.stiffness[grid] + terms.damping[grid])


def holding(h: float, near: float, contacts: int, terms: Terms, state: State, scratch: Scratch) -> Bools:
    """Which contacts (k,) have to balance the loads of a step without momentum: those that are closer than
    `near`, pushed in the last step, or are closed by driven motion within h."""
    d = state.force.shape[1]
    moved = -h * (terms.rows[: contacts * d : d] @ state.speed)
    pushed = state.modes[scratch.slots[:contacts]] != OPEN
    return np.asarray((terms.gap[:contacts] <= np.maximum(near, moved)) | pushed)


def lacking(unsupported: bool, overlaps: bool, residual: float) -> str:
    """What an attempt lacks, however short, that has no proof, as a clause: support, room, or a solution."""
    if unsupported:
        return "forces do not balance without inertia, and no certificate says why"
    if overlaps:
        return "bodies overlap after each step, however short: their contacts change more than they move"
    if residual <= TOLERANCE:
        return "only forces far beyond all that loads call for solve the step"
    return f"no step, however short, has a solution, and no certificate says why (residual {residual:.1e})"
