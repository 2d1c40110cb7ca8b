"""Questions about many states: gaps, poses, and values of conditions' terms."""

from __future__ import annotations

import math

from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.scene.language.expression import evaluate
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.records import Records
from rungwise.scene.template.template import Numbers
from rungwise.simulation.planar.state.nearby import look
from rungwise.simulation.planar.state.ways import set_ways
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.watched.values import TIME, Conditions
from rungwise.system.planar.contact_manifold import ABSENT
from rungwise.system.planar.place import place


@kernel
def answer(
    records: Records,
    numbers: Numbers,
    buffer: Reals,
    terms: Conditions,
    workspace: Workspace,
    q: Reals,
    v: Reals,
    rest: Reals,
    columns: Ints,
    values: Reals,
    gaps: Reals,
    poses: Reals,
) -> None:
    """At each state, fill in the terms' values (m, k), gaps of contacts (m, c) and poses of bodies
    (m, b, 4). q, v (m, n); `rest` (m, 1 + 2 c + u + slots) holds the time, forces and impulses of contacts,
    the inputs, which expressions read at `columns` (u,), and since when parts of conditions have held. Where
    bodies may be raised, `numbers` write to the scene's `buffer` how high they are."""
    state = workspace.state
    clock, contacts = state.clock[0], gaps.shape[1]
    inputs = 1 + 2 * contacts
    for i in range(q.shape[0]):
        copy(q[i], state.q)
        copy(v[i], state.v)
        state.values[workspace.watched.slots[TIME]] = rest[i, 0]
        copy(rest[i, 1 : 1 + contacts], state.pushes)
        copy(rest[i, 1 + contacts : inputs], state.impulses)
        for j in range(columns.shape[0]):
            state.values[columns[j]] = rest[i, inputs + j]
        copy(rest[i, inputs + columns.shape[0] :], state.dates)
        if clock.lifts:
            evaluate_numbers(numbers, state.values, workspace.watched.stack, buffer)
        set_ways(records, state)
        state.manifolds.features[:] = ABSENT
        clock.margin, clock.tried, clock.next = math.inf, 0.0, 0.0
        place(records, state.q, state.placed, False)
        look(records, workspace, state.v)
        copy(state.manifolds.gaps, gaps[i])
        copy(state.placed.pose, poses[i])
        code, constants, table = terms
        for k in range(values.shape[1]):
            values[i, k] = evaluate(
                code, constants, table[k, 0], table[k, 1], state.values, workspace.watched.stack
            )


@kernel
def read(terms: Conditions, numbers: Reals, stack: Reals, values: Reals) -> None:
    """The terms' values (m, k) at rows (m, w) of the numbers that conditions read."""
    code, constants, table = terms
    for i in range(numbers.shape[0]):
        for k in range(values.shape[1]):
            values[i, k] = evaluate(code, constants, table[k, 0], table[k, 1], numbers[i], stack)
