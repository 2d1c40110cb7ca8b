"""What can be wrong with a scene whose numbers are known."""

from __future__ import annotations

from rungwise.scene.fields.laws.contact import LAWS

(
    BOUND,
    OUT_OF_RANGE,
    NOT_CONVEX,
    NO_NORMAL,
    NO_AXIS,
    NO_MASS,
    NO_INERTIA,
    OUT_OF_TRAVEL,
    NO_JOINT_AXIS,
    NOT_POSITIVE,
    NO_AREA,
    NO_WEIGHT,
    OVERHANGS,
    REFUSED,
) = range(14)
FAULTS = {
    NOT_CONVEX: "the outline is not a convex polygon with distinct vertices",
    NO_NORMAL: "the normal has no length",
    NO_AXIS: "the axis has no length",
    NO_MASS: "a body that forces move needs a mass greater than 0 (give mass, or a shape with area)",
    NO_INERTIA: "a body that turns freely needs an inertia greater than 0"
    " (give inertia, or a shape with area)",
    NO_JOINT_AXIS: "the axis has no length",
    NOT_POSITIVE: "coupling must be below the square root of normal times tangential (stiffness or damping)",
    NO_AREA: "uniform pressure needs a shape with area; valid without: ring, points, ratio",
    NO_WEIGHT: "one of the weights must be greater than 0",
    OVERHANGS: "no pressure under the body has its centre there: it must be within the convex hull of the"
    " shapes, or of the points of the pressure",
    OUT_OF_TRAVEL: "the start lies outside lower..upper",
} | {REFUSED + k: law.refusal for k, law in enumerate(LAWS)}
"""Fault of a binding -> what is wrong, from REFUSED on by a law of contact; the second number of a fault is
the index of check, shape, body, coordinate, joint, contact or support."""
