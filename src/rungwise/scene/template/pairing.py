"""Which bodies may touch, and how: contact entries of a scene, and the pairs of shapes they stand for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import combinations

import numpy as np

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import SceneFile
from rungwise.scene.fields.laws.contact import Contact
from rungwise.scene.fields.shapes import HalfPlane, Shape
from rungwise.scene.fields.values import shown
from rungwise.wording import choices


def matched(scene: SceneFile) -> Iterator[tuple[tuple[str, str], int, Contact]]:
    """Pairs of bodies, each with the number of the first entry that names the pair, and the entry."""
    bodies = scene.bodies
    for entry, contact in enumerate(scene.contacts):
        if contact.between[0] == contact.between[1] and contact.between[0] in bodies:
            raise SceneError(f"contacts.{entry}.between: must name two bodies")
        for k, pattern in enumerate(contact.between):
            if not any(fnmatchcase(name, pattern) for name in bodies):
                path = f"contacts.{entry}.between.{k}"
                raise SceneError(f"{path}: {shown(pattern)} names no body{choices(pattern, bodies)}, or *")
    for pair in combinations(bodies, 2):
        if all(not bodies[name].coordinate_names for name in pair):
            continue
        jointed = any(set(joint.between) == set(pair) for joint in scene.joints.values())
        for entry, contact in enumerate(scene.contacts):
            a, b = contact.between
            if jointed and {a, b} != set(pair):
                continue
            if any(fnmatchcase(x, a) and fnmatchcase(y, b) for x, y in (pair, pair[::-1])):
                yield pair, entry, contact
                break


def shape_pairs(
    shapes: Mapping[str, Sequence[tuple[str, Shape]]], contacts: Sequence[tuple[str, str]]
) -> Iterator[tuple[int, int, int]]:
    """The contact and the two shapes, counted through all bodies, of each pair that may touch."""
    bodies, many = list(shapes), list(shapes.values())
    first = np.cumsum([0] + [len(own) for own in many])
    for index, pair in enumerate(contacts):
        a, b = (bodies.index(name) for name in pair)
        for i, (_, shape_a) in enumerate(many[a]):
            for j, (_, shape_b) in enumerate(many[b]):
                if not (isinstance(shape_a, HalfPlane) and isinstance(shape_b, HalfPlane)):
                    yield index, int(first[a]) + i, int(first[b]) + j
