"""Rows of the friction of supports: bodies that lie on a table seen from above."""

from __future__ import annotations

from rungwise.kernel import Reals, Record, RecordArray, kernel
from rungwise.scene.template.records import FREE, SPEED, Records
from rungwise.system.planar.place import COS, SIN
from rungwise.system.planar.pressed import place_surface
from rungwise.system.terms import SUPPORT, Terms


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
        for j in range(3):
            length = 1.0 if j < 2 else support.ratio
            if support.row >= 0 and length > 0.0:
                terms.limited[count, i + j] = length
                terms.limit[count] = support.force
                terms.account[count], terms.surface[count] = SUPPORT, support.body
                count += 1
    return count


@kernel
def turn_supports(records: Records, pose: Reals, terms: Terms) -> None:
    """Rows of the supports where the bodies are: rates of the centre of pressure."""
    exact = 0
    for k in range(records.supports.shape[0]):
        support = records.supports[k]
        if support.exact:
            place_surface(support, pose, terms.exact[exact])
            exact += 1
        if support.row >= 0:
            turn = records.bodies[support.body].coordinate + 2
            c, s = pose[support.body, COS], pose[support.body, SIN]
            terms.limited[support.row, turn] = -(s * support.centre_x + c * support.centre_y)
            terms.limited[support.row + 1, turn] = c * support.centre_x - s * support.centre_y


@kernel
def slides_any_way(body: Record, coordinates: RecordArray) -> bool:
    """Whether dry friction acts on a body along several coordinates: then it is one force against the motion,
    whatever the heading."""
    rubbed = 0
    if body.motion == FREE:
        for i in range(body.coordinate, body.coordinate + 3):
            rubbed += coordinates[i].dry_friction > 0.0 and coordinates[i].drive != SPEED
    return rubbed > 1
