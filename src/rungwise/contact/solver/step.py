"""A step's problem, given to the solver and answered in its own rows."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.block_factors import Factors
from rungwise.contact.solver.groups import (
    Counts,
    Groups,
    count_groups,
    count_in_units,
    fill_groups,
    groups_in,
    integers_of,
    reals_of,
)
from rungwise.contact.solver.islands import cut_island, label_islands
from rungwise.contact.solver.newton import Room, evaluate, no_blocks, plan_blocks, room_in, room_of
from rungwise.contact.solver.settings import NEWTON_STEPS, WIDE
from rungwise.contact.solver.solve import BY_ITERATE, measure, rests, set_pace, solve
from rungwise.contact.step.modes import clear
from rungwise.contact.step.problem import ContactProblem, Sizes, Surfaces, Unknowns
from rungwise.contact.step.spans import diagonal
from rungwise.contact.step.status import GUESS, NO_SOLUTION, PROXIMAL, SOLVED, TOLERANCE
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel


@allocating_kernel
def solve_groups(
    p: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    law: int,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> tuple[int, float, int, int]:
    """Solve from the forces and velocities given, into these and the modes; returns (status, residual,
    what answered, Newton steps), where the contacts are of the kind `law`. It ends without an answer when
    halt (1,) is set. `surfaces`, `columns` and `couplings`: see `fill_groups`."""
    for i in range(sizes.n):
        if not diagonal(p.H, couplings, i) > 0.0:
            return NO_SOLUTION, math.inf, GUESS, 0
    whole = count_groups(p, sizes, surfaces, columns, couplings)
    reals, integers = np.empty(reals_of(whole)), np.empty(integers_of(whole), np.int64)
    n, members, d = whole.n, whole.n + whole.groups, p.R.shape[1]
    scratch, room = np.empty(2 * members + 2 * n, np.int64), np.empty(room_of(whole))
    count, numbers = np.zeros(4, np.int64), surfaces.pressures
    order = np.empty(members, np.int64)
    apart = _begin(p, sizes, law, surfaces, columns, couplings, reals, integers, whole, scratch)
    part, own_reals, own_integers, worst = whole, reals, integers, 0.0
    if apart > 1:
        own_reals, own_integers = np.empty(len(reals)), np.empty(len(integers), np.int64)
    rows = d * sizes.contacts
    for which in range(apart):
        if apart > 1:
            part = cut_island(reals, integers, whole, numbers, scratch, which, own_reals, own_integers)
        count[3] = count[0] + NEWTON_STEPS
        stays, found = _rest(
            own_reals, own_integers, part, numbers, scratch, room, order, unknowns, sizes, rows
        )
        if not stays and part.n < WIDE:
            found = _solve_few(
                own_reals, own_integers, part, numbers, scratch, room, order, unknowns, sizes, rows, halt,
                count,
            )  # fmt: skip
        elif not stays:
            blocks = plan_blocks(own_integers, part)
            found = _solve_part(
                own_reals, own_integers, part, numbers, scratch, room, order, blocks, unknowns, sizes, rows,
                halt, count,
            )  # fmt: skip
        worst = max(worst, found)
        if not worst <= TOLERANCE:
            break
    solved = worst <= TOLERANCE
    if not solved:
        clear(d, sizes, unknowns)
    if not solved:
        worst = residual_of_groups(p, sizes, unknowns, law, surfaces, columns, couplings)
    stage = PROXIMAL if count[1] > apart else GUESS
    return SOLVED if solved else NO_SOLUTION, worst, stage, count[0]


@allocating_kernel
def residual_of_groups(
    p: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    law: int,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
) -> float:
    """The greatest residual (see `residual`) of the parts of an answer that nothing joins; inf where forces
    exceed by far what the problem calls for."""
    whole = count_groups(p, sizes, surfaces, columns, couplings)
    reals, integers = np.empty(reals_of(whole)), np.empty(integers_of(whole), np.int64)
    members, numbers = whole.n + whole.groups, surfaces.pressures
    scratch, room = np.empty(2 * members + 2 * whole.n, np.int64), np.empty(room_of(whole))
    own_reals, own_integers = np.empty(len(reals)), np.empty(len(integers), np.int64)
    order, worst, rows = np.empty(members, np.int64), 0.0, p.R.shape[1] * sizes.contacts
    for which in range(_begin(p, sizes, law, surfaces, columns, couplings, reals, integers, whole, scratch)):
        part = cut_island(reals, integers, whole, numbers, scratch, which, own_reals, own_integers)
        found = _measure(own_reals, own_integers, part, numbers, scratch, room, order, unknowns, sizes, rows)
        worst = max(worst, found)
    return worst


@kernel
def _measure(
    reals: Reals, integers: Ints, part: Counts, numbers: Reals, scratch: Ints, room: Reals, order: Ints,
    unknowns: Unknowns, sizes: Sizes, rows: int,
) -> float:  # fmt: skip
    """The residual of an island."""
    g = groups_in(reals, integers, part, numbers)
    here = room_in(room, order, part, no_blocks(integers, reals))
    count_in_units(g)
    _take(g, scratch[len(scratch) - 2 * sizes.n :], unknowns, rows, here.x, here.v)
    return measure(g, here.x, here.v, here)


@kernel
def _begin(
    p: ContactProblem,
    sizes: Sizes,
    law: int,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    reals: Reals,
    integers: Ints,
    whole: Counts,
    scratch: Ints,
) -> int:
    """Fill the groups, and label islands in `scratch`, where all velocities are an island's own at first;
    returns how many there are."""
    g, members = groups_in(reals, integers, whole, surfaces.pressures), whole.n + whole.groups
    fill_groups(p, sizes, law, surfaces, columns, couplings, g)
    for i in range(whole.n):
        scratch[2 * members + i] = i
    return label_islands(g, scratch[:members], scratch[members : 2 * members])


@kernel
def _rest(
    reals: Reals, integers: Ints, part: Counts, numbers: Reals, scratch: Ints, room: Reals, order: Ints,
    unknowns: Unknowns, sizes: Sizes, rows: int,
) -> tuple[bool, float]:  # fmt: skip
    """Count an island in units, with the problem's unknowns; returns whether it rests by the forces given,
    which are its answer then, and the residual of that."""
    g = groups_in(reals, integers, part, numbers)
    here = room_in(room, order, part, no_blocks(integers, reals))
    own = scratch[len(scratch) - 2 * sizes.n :]
    count_in_units(g)
    _take(g, own, unknowns, rows, here.x, here.v)
    stays = rests(g, here.x, here.v, here)
    if stays:
        _give(g, own, sizes, rows, here.x, here.v, here, unknowns)
    return stays, here.least[0]


@kernel
def _solve_few(
    reals: Reals, integers: Ints, part: Counts, numbers: Reals, scratch: Ints, room: Reals, order: Ints,
    unknowns: Unknowns, sizes: Sizes, rows: int, halt: Ints, count: Ints,
) -> float:  # fmt: skip
    """As `_solve_part`, where the matrix is dense."""
    blocks = no_blocks(integers, reals)
    return float(
        _solve_part(
            reals, integers, part, numbers, scratch, room, order, blocks, unknowns, sizes, rows, halt, count
        )
    )


@kernel
def _solve_part(
    reals: Reals, integers: Ints, part: Counts, numbers: Reals, scratch: Ints, room: Reals, order: Ints,
    blocks: Factors, unknowns: Unknowns, sizes: Sizes, rows: int, halt: Ints, count: Ints,
) -> float:  # fmt: skip
    """Solve an island that does not rest, counted in units, from its unknowns into the problem's; returns
    the residual."""
    g, here = groups_in(reals, integers, part, numbers), room_in(room, order, part, blocks)
    found = solve(g, here.x, here.v, here, halt, count)
    _give(g, scratch[len(scratch) - 2 * sizes.n :], sizes, rows, here.x, here.v, here, unknowns)
    return found


@inner_kernel
def _take(g: Groups, own: Ints, unknowns: Unknowns, rows: int, x: Reals, v: Reals) -> None:
    """Count the unknowns of a problem, whose contacts have so many rows, in the units of the groups;
    velocities are these of the problem's."""
    for r in range(len(x)):
        at = g.origin[r]
        x[r] = (unknowns.force[at] if at < rows else unknowns.tau[at - rows]) / g.force[r]
    for i in range(len(v)):
        v[i] = unknowns.v[own[i]] / g.unit[i]


@inner_kernel
def _give(
    g: Groups, own: Ints, sizes: Sizes, rows: int, x: Reals, v: Reals, room: Room, unknowns: Unknowns
) -> None:
    """Write forces, velocities and modes, as the problem counts them, of an answer that was measured last."""
    set_pace(g, BY_ITERATE, room)
    evaluate(g, 0.0, 0.0, x, v, x, v, room)
    for r in range(len(x)):
        at = g.origin[r]
        if at < rows:
            unknowns.force[at] = x[r] * g.force[r]
        else:
            unknowns.tau[at - rows] = x[r] * g.force[r]
    for i in range(len(v)):
        unknowns.v[own[i]] = v[i] * g.unit[i]
    for k in range(len(g.kind)):
        for r in range(g.row[k], g.row[k + 1]):
            at = g.origin[r]
            if at >= rows:
                unknowns.mode[sizes.contacts + at - rows] = room.mode[k]
            elif r == g.row[k]:
                unknowns.mode[at * sizes.contacts // rows] = room.mode[k]
