"""Rows of the friction of supports: bodies that lie on a table seen from above."""

from __future__ import annotations

from rungwise.kernel import Reals, Record, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.scene.template.records import FREE, POINTS, SPEED, Records
from rungwise.system.planar.place import COS, SIN
from rungwise.system.planar.pressed import place_surface
from rungwise.system.terms import SUPPORT, Terms


def foot_rows(records: Records) -> int:
    """Rows of the points that carry bodies by Coulomb's law at each of them."""
    own = records.supports[(records.supports["exact"] != 0) & (records.supports["pressure"] == POINTS)]
    return int(2 * (own["end"] - own["first"]).sum())


@kernel
def enter_supports(records: Records, count: int, terms: Terms) -> int:
    """Rows of the supports, from row `count`; returns how many rows there are then. A row of the angle is one
    of length c, so that the greatest force is the same in all directions."""
    supports, bodies, coordinates = records.supports, records.bodies, records.coordinates
    for k in range(supports.shape[0]):
        support = supports[k]
        i, free = bodies[support.body].coordinate, False
        for j in range(3):
            free |= coordinates[i + j].drive != SPEED
        support.row = count if free and support.force > 0.0 else -1
        if support.row >= 0 and _stands_on_feet(support):
            count = _enter_feet(support, records, i, count, terms)
            continue
        for j in range(3):
            length = 1.0 if j < 2 else support.ratio
            if support.row >= 0 and length > 0.0:
                terms.limited[count, i + j] = length
                terms.limit[count] = support.force
                terms.account[count], terms.surface[count] = SUPPORT, support.body
                count += 1
    return count


@inner_kernel
def _stands_on_feet(support: Record) -> bool:
    """Whether each of a few points has its own load, and rubs by itself."""
    return bool(support.exact and support.pressure == POINTS)


@rare_kernel
def _enter_feet(support: Record, records: Records, i: int, count: int, terms: Terms) -> int:
    """Two rows of each point that carries a part of the load."""
    total = 0.0
    for k in range(support.first, support.end):
        total += records.spots[k].weight
    for k in range(support.first, support.end):
        if records.spots[k].weight > 0.0:
            number = records.bodies.shape[0] + count
            for j in range(2):
                terms.limited[count, i + j] = 1.0
                terms.limit[count] = support.force * records.spots[k].weight / total
                terms.account[count], terms.surface[count] = SUPPORT, number
                count += 1
    return count


@kernel
def turn_supports(records: Records, pose: Reals, terms: Terms) -> None:
    """Rows of the supports where the bodies are: rates of the centre of pressure, or of points."""
    exact = 0
    for k in range(records.supports.shape[0]):
        support = records.supports[k]
        feet = _stands_on_feet(support)
        if support.exact and not feet:
            place_surface(support, pose, terms.exact[exact])
            exact += 1
        if support.row >= 0:
            turn = records.bodies[support.body].coordinate + 2
            c, s = pose[support.body, COS], pose[support.body, SIN]
            if feet:
                _turn_feet(support, records, turn, c, s, terms)
            else:
                _turn_place(support.row, turn, support.centre_x, support.centre_y, c, s, terms)


@rare_kernel
def _turn_feet(support: Record, records: Records, turn: int, c: float, s: float, terms: Terms) -> None:
    body, row = records.bodies[support.body], int(support.row)
    for k in range(support.first, support.end):
        spot = records.spots[k]
        if spot.weight > 0.0:
            _turn_place(row, turn, spot.x - body.centre_x, spot.y - body.centre_y, c, s, terms)
            row += 2


@inner_kernel
def _turn_place(row: int, turn: int, x: float, y: float, c: float, s: float, terms: Terms) -> None:
    """What a turn adds to the rates of a place from the centre of mass, in the body's frame."""
    terms.limited[row, turn] = -(s * x + c * y)
    terms.limited[row + 1, turn] = c * x - s * y


@kernel
def slides_any_way(body: Record, coordinates: RecordArray) -> bool:
    """Whether dry friction acts on a body along several coordinates: then it is one force against the motion,
    whatever the heading."""
    rubbed = 0
    if body.motion == FREE:
        for i in range(body.coordinate, body.coordinate + 3):
            rubbed += coordinates[i].dry_friction > 0.0 and coordinates[i].drive != SPEED
    return rubbed > 1
