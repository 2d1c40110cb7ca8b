"""Laws of contact between geoms, from the entries of a scene, and what stands for numbers that none gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals, RecordArray
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.laws.contact import LAWS, RECORD, STICKS, named_by, refused
from rungwise.scene.fields.values import Number
from rungwise.scene.scene import InvalidScene
from rungwise.scene.space.fields import Contact
from rungwise.scene.space.labels import Labels, wholes

if TYPE_CHECKING:
    import mujoco

SINKS = 1e-3
"""Under the weight of all that moves a contact of the stiffness that is taken by default yields by this part
of the smallest geom."""
RATIO = 0.5
"""Damping ratio of the damping that is taken by default, for a body of the mean mass."""
FROM = {"torsional_friction": 4, "rolling_friction": 6}
"""Kinds of friction, and the condim from which on contacts have them."""
RUBS = 3
"""The condim from which on contacts have friction."""
LEAST = 1e-5
"""Friction that MuJoCo takes for none."""
EARTH = 9.81
"""Gravity (m/s^2) that stiffness is measured by where the model has none."""


def contact_laws(
    model: mujoco.MjModel,
    names: Labels,
    entries: Sequence[Contact],
    number: Callable[[float | str, str], float],
) -> tuple[Ints, Reals]:
    """law (g, g) and rows (l, 8): normal and tangential stiffness and damping, restitution, and sliding,
    torsional and rolling friction, nan for the model's. Raises SceneError for names that nothing has,
    InvalidScene for impossible numbers."""
    stiffness, damping = default_law(model)
    rows: list[tuple[float, ...]] = [(stiffness, stiffness, damping, damping, 0.0, *(math.nan,) * 3)]
    law = np.zeros((model.ngeom, model.ngeom), np.int64)
    for k, (entry, sides) in enumerate(zip(entries, sides_of(model, names, entries), strict=True)):
        rows.append(_row(entry, f"contacts.{k}", stiffness, damping, number))
        for a, b in (sides, sides[::-1]):
            both = np.ix_(a, b)
            law[both] = np.where(law[both] == 0, k + 1, law[both])
    return law, np.array(rows)


def named_laws(
    model: mujoco.MjModel,
    law: Ints,
    entries: Sequence[Contact],
    tolerance: Number,
    number: Callable[..., float],
) -> RecordArray:
    """What entries name beside the common laws (l,), by rows as of `contact_laws`. Raises InvalidScene for
    impossible numbers, naming the field."""
    records = np.zeros(len(entries) + 1, RECORD)
    for k, entry in enumerate(entries):
        record, path = records[k + 1], f"contacts.{k}"
        record["laws"] = named_by(entry)
        if not record["laws"]:
            continue
        record["friction"] = (
            math.nan if entry.friction is None else number(entry.friction, f"{path}.friction")
        )
        for each in (each for one in LAWS for each in one.numbers):
            given = getattr(entry, each.field)
            value = each.otherwise(entry, tolerance) if given is None else given
            x = 0.0 if value is None else number(value, f"{path}.{each.field}", infinite=each.infinite)
            if x < 0.0 or (each.above is not None and x <= each.above):
                least = ">= 0" if each.above is None else f"> {each.above:g}"
                raise InvalidScene(f"{path}.{each.field}: {x:g} must be {least}")
            record[each.field] = x
        wrong = refused(record)
        if wrong >= 0:
            raise InvalidScene(f"{path}: {LAWS[wrong].refusal}")
        if record["laws"] & STICKS:
            _check_static(model, law == k + 1, record, path)
    return records


def _check_static(model: mujoco.MjModel, own: NDArray[np.bool_], record: Any, path: str) -> None:
    """Raise InvalidScene where static friction of the pairs of geoms (g, g) of an entry is below the model's
    friction, or is of contacts that turn with friction and do not slide with any."""
    static, least = float(record["static_friction"]), float(record["friction"])
    pairs = [(a, b) for a, b in touching_pairs(model).tolist() if own[a, b]]
    turns = any(_directions(model, np.array([a]), np.array([b])) > RUBS for a, b in pairs)
    if least == 0.0 and static > 0.0 and turns:
        raise InvalidScene(f"{path}.static_friction: contacts that resist turning need friction above 0")
    if math.isnan(least):
        for a, b in pairs:
            friction = _model_friction(model, a, b)
            if static < friction:
                names = " and ".join(model.geom(g).name or f"geom {g}" for g in wholes(model)[[a, b]])
                raise InvalidScene(
                    f"{path}.static_friction: {static:g} is below the model's friction of {names},"
                    f" {friction:g}; give friction as well"
                )


def _model_friction(model: mujoco.MjModel, a: int, b: int) -> float:
    """Sliding friction that MuJoCo gives a contact of two geoms, the greatest of its directions."""
    for p in range(model.npair):
        if {int(model.pair_geom1[p]), int(model.pair_geom2[p])} == {a, b}:
            return float(model.pair_friction[p, :2].max())
    one, other = (float(model.geom_friction[g, 0]) for g in (a, b))
    first, second = (int(model.geom_priority[g]) for g in (a, b))
    return max(one, other) if first == second else one if first > second else other


def sides_of(model: mujoco.MjModel, names: Labels, entries: Sequence[Contact]) -> list[tuple[Ints, Ints]]:
    """Geoms that each entry names on either side. Raises SceneError for names that nothing has, and for
    friction of a kind that none of these geoms has."""
    found = []
    for k, entry in enumerate(entries):
        a, b = (
            _matching(model, names, pattern, f"contacts.{k}.between.{i}")
            for i, pattern in enumerate(entry.between)
        )
        directions = _directions(model, a, b)
        for name, least in (FROM | {"static_friction": RUBS}).items():
            if getattr(entry, name) is not None and directions < least:
                raise SceneError(f"contacts.{k}.{name}: these contacts have condim {directions}, not {least}")
        found.append((a, b))
    return found


def _directions(model: mujoco.MjModel, a: Ints, b: Ints) -> int:
    """The greatest condim of contacts between geoms a and geoms b."""
    one, other = model.geom_condim[a], model.geom_condim[b]
    pairs = np.stack([model.pair_geom1, model.pair_geom2])
    named = (np.isin(pairs[0], a) & np.isin(pairs[1], b)) | (np.isin(pairs[0], b) & np.isin(pairs[1], a))
    return int(max(one.max(), other.max(), model.pair_dim[named].max(initial=1)))


def touching(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """For each geom (g,) whether it can touch any other: by its types, or by a pair that names it."""
    found: NDArray[np.bool_] = (model.geom_contype | model.geom_conaffinity) != 0
    found[model.pair_geom1] = True
    found[model.pair_geom2] = True
    return found


def touching_pairs(model: mujoco.MjModel) -> Ints:
    """Geoms (k, 2) that MuJoCo's rules let touch: of bodies that move to each other and are not parent and
    child, by their types; without those that are excluded, and with pairs that are named."""
    import mujoco

    m, weld = model, model.body_weldid
    if m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        return np.zeros((0, 2), np.int64)
    parent, count = weld[m.body_parentid[weld]], m.ngeom
    a, b = np.triu_indices(count, 1)
    one, two = m.geom_bodyid[a], m.geom_bodyid[b]
    mine, other = weld[one], weld[two]
    moves = mine != other
    if not m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        is_near = (mine == parent[other]) | (other == parent[mine])
        moves &= ~(is_near & (mine > 0) & (other > 0))
    is_excluded = np.isin((np.minimum(one, two) << 16) + np.maximum(one, two), m.exclude_signature)
    fits = (m.geom_contype[a] & m.geom_conaffinity[b]) | (m.geom_contype[b] & m.geom_conaffinity[a])
    chosen = moves & ~is_excluded & (fits != 0)
    named = np.sort(np.stack([m.pair_geom1, m.pair_geom2]), axis=0).astype(np.int64)
    if named.size == 0:  # all are in order, and to find out takes long where geoms are many
        return np.stack([a[chosen], b[chosen]], axis=1)
    numbers = np.unique(np.append(a[chosen] * count + b[chosen], named[0] * count + named[1]))
    return np.stack(np.divmod(numbers, max(count, 1)), axis=1)


def _sizes(model: mujoco.MjModel) -> Reals:
    """Radii of the geoms that move and may touch, of pieces those of what they stand for."""
    moving = touching(model) & (model.body_weldid[model.geom_bodyid] != 0) & (model.geom_rbound > 0.0)
    return np.asarray(model.geom_rbound[np.unique(wholes(model)[moving])])


def give_friction(data: mujoco.MjData, law: Ints, rows: Reals) -> bool:
    """Give contacts of MuJoCo the friction of their laws (see `contact_laws`); sliding friction changes
    torsional and rolling friction that have none of their own alike. Returns whether any has other friction
    now."""
    found = data.contact
    if not data.ncon:
        return False
    own, (slide, twist, roll) = found.friction.copy(), rows[law[tuple(found.geom.T)], 5:].T
    part = np.where(np.isnan(slide), 1.0, slide / np.maximum(own[:, 0], LEAST))
    wanted = own * part[:, None]
    for columns, given in ((slice(0, 2), slide), (slice(2, 3), twist), (slice(3, 5), roll)):
        told = ~np.isnan(given)
        wanted[told, columns] = given[told, None]
    wanted = np.maximum(wanted, LEAST)
    if (wanted == own).all():
        return False
    found.friction[:] = wanted
    return True


def default_law(model: mujoco.MjModel) -> tuple[float, float]:
    """Stiffness and damping of contacts for which the scene gives none."""
    moving = model.body_weldid != 0
    mass = float(model.body_mass[moving].sum()) or 1.0
    sizes = _sizes(model)
    gravity = float(np.linalg.norm(model.opt.gravity)) or EARTH
    stiffness = mass * gravity / (SINKS * float(sizes.min(initial=np.inf))) if len(sizes) else 1.0
    count = max(int((model.body_mass[moving] > 0.0).sum()), 1)
    return stiffness, 2.0 * RATIO * math.sqrt(stiffness * mass / count)


def smallest(model: mujoco.MjModel) -> float:
    """Radius of the smallest geom that moves and may touch; inf where there is none."""
    return float(_sizes(model).min(initial=np.inf))


def _row(
    entry: Contact,
    path: str,
    stiffness: float,
    damping: float,
    number: Callable[[float | str, str], float],
) -> tuple[float, ...]:
    """Numbers of an entry; stiffness and damping are those of a contact that names neither."""

    def value(name: str, otherwise: float) -> float:
        given = getattr(entry, name)
        return otherwise if given is None else number(given, f"{path}.{name}")

    normal = value("stiffness", stiffness)
    damping = value("damping", damping if entry.stiffness is None else 0.0)
    across, drag = value("tangential_stiffness", normal), value("tangential_damping", damping)
    restitution = value("restitution", 0.0)
    for name, x, least in (
        ("stiffness", normal, 0.0), ("tangential_stiffness", across, 0.0), ("damping", damping, -1.0),
        ("tangential_damping", drag, -1.0), ("restitution", restitution, -1.0),
    ):  # fmt: skip
        if not least < x < math.inf or x < 0.0 or (name == "restitution" and x > 1.0):
            raise InvalidScene(f"{path}.{name}: {x:g} is outside its range")
    frictions = [value(name, math.nan) for name in ("friction", *FROM)]
    for name, x in zip(("friction", *FROM), frictions, strict=True):
        if x < 0.0:
            raise InvalidScene(f"{path}.{name}: {x:g} must be >= 0")
    return normal, across, damping, drag, restitution, *frictions


def _matching(model: mujoco.MjModel, names: Labels, pattern: str, path: str) -> Ints:
    """Numbers of the geoms whose name, or whose body's name, the pattern matches."""
    of = wholes(model).tolist()
    found = [
        g
        for g in range(model.ngeom)
        if any(
            fnmatchcase(name, pattern)
            for name in (
                names.geoms[g], model.geom(of[g]).name,
                names.bodies[model.geom_bodyid[g]], model.body(model.geom_bodyid[g]).name,
            )
        )
    ]  # fmt: skip
    if not found:
        raise SceneError(f"{path}: {pattern[:60]!r} matches no geom and no body")
    return np.array(found, np.int64)
