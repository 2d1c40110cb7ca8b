"""Units of parameters against the places that the parameters feed."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping

from rungwise.scene.contract import AnyScene
from rungwise.scene.dimensions.expressions import NONE, Lookup, Mixed, Powers, check_condition, dimension
from rungwise.scene.dimensions.places import ANGLE, LENGTH, RATIO, SPEED, TURN, Kind, Place, places
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import Free, Hinge, SceneFile
from rungwise.scene.fields.stated import Stated
from rungwise.scene.language.lasting import parsed
from rungwise.scene.language.poses import AT, TILT
from rungwise.scene.language.units import measured
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.fields import SpaceFile
from rungwise.scene.space.labels import PLACES, RATES, TURNS

CONDITIONS = ("goal", "unsafe", "doomed")
SI = ("m", "kg", "s")
_ABOUT = re.compile(r"atan2\(2 \* (\w+)\.qw \* \1\.q([xyz]), .*?\.q\2 \* \1\.q\2\)")
"""What an angle about an axis is rewritten into."""


def check_dimensions(scene: AnyScene) -> None:
    """Raise SceneError, with the field, for a parameter whose unit does not fit a place that it feeds. A
    parameter without a unit, or with the unit 1, fits all; so do expressions without such a parameter, whose
    numbers may have any unit, as the time in ``2 * t``."""
    if not isinstance(scene.file, SceneFile | SpaceFile | Stated):
        return
    units = {name: each.unit for name, each in scene.file.parameters.items() if each.unit != "1"}
    if not units:
        return
    coordinates = _coordinates(scene)
    known = _lookup(units, coordinates)
    found = sorted(places(scene.file, coordinates), key=lambda place: place.text.strip() not in units)
    for place in found:  # first those of one parameter alone, whose unit then is at fault
        _check(place, units, known, found)
    for field in CONDITIONS:
        text = getattr(scene.file, field)
        tree = None if text is None else parsed(text)
        if tree is not None and _named(tree, units):
            try:
                check_condition(tree, known)
            except Mixed as mixed:
                raise SceneError(f"{field}: {_mixed(mixed, units)}") from None


def _lookup(units: Mapping[str, str], coordinates: Mapping[str, Kind]) -> Lookup:
    powers = {name: Powers(*measured(unit).powers) for name, unit in units.items()}
    powers |= {name: kind.powers for name, kind in coordinates.items()}
    functions = {"gap": Powers(1), "force": Powers(1, 1, -2), "impulse": Powers(1, 1, -1)}
    functions |= {AT: Powers(1), TILT: NONE}

    def known(name: str) -> Powers | None:
        return powers.get(name, functions.get(name.partition("(")[0]))

    return known


def _coordinates(scene: AnyScene) -> dict[str, Kind]:
    """What coordinates are, by their names, and velocities, by ``speed(name)``."""
    found: dict[str, Kind] = {}
    if isinstance(scene.file, SceneFile):
        for name, body in scene.file.bodies.items():
            for each in body.coordinate_names:
                turns = isinstance(body.motion, Hinge) or (isinstance(body.motion, Free) and each == "angle")
                found[f"{name}.{each}"] = ANGLE if turns else LENGTH
                found[f"speed({name}.{each})"] = TURN if turns else SPEED
    elif isinstance(scene, SpaceScene):
        for name in scene.labels.coordinates:
            # only free bodies: of other joints names do not tell whether they slide or turn
            if name.endswith(".qw"):
                own = name.removesuffix(".qw")
                found |= {f"{own}.{each}": LENGTH for each in PLACES}
                found |= {f"{own}.{each}": RATIO for each in TURNS}
                found |= {f"speed({own}.{each})": SPEED for each in PLACES}
                found |= {f"speed({own}.{each})": TURN for each in RATES}
    return found


def _check(place: Place, units: Mapping[str, str], known: Lookup, others: list[Place]) -> None:
    try:
        tree = parsed(place.text)
        own = dimension(tree, known) if _named(tree, units) else None
    except Mixed as mixed:
        raise SceneError(f"{place.path}: {_mixed(mixed, units)}") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # no expression, as binding says in its own words
    name = tree.id if isinstance(tree, ast.Name) else ""
    is_angle = name in units and place.kind is RATIO and units[name] in ("rad", "deg")
    if own is None or (own == place.kind.powers and not is_angle):
        return
    wants = f"{place.path} is {place.kind.name}, in {place.kind.unit}"
    if not name:
        raise SceneError(
            f"{place.path}: {place.text[:60]!r} is in {_written(own)}, but {wants}{_stated(tree, units)}"
        )
    fits = [
        each.path
        for each in others
        if each.text.strip() == name and each.kind.powers == own and each != place
    ]
    also = f"; it fits {fits[0]}: take a parameter for each" if fits and not is_angle else ""
    raise SceneError(
        f"parameters.{name}.unit: {units[name]} does not fit where {name} is used: {wants}{also}"
    )


def _mixed(mixed: Mixed, units: Mapping[str, str]) -> str:
    one, its, other, theirs = mixed.args
    named = _stated(one if other is None else ast.Tuple([one, other]), units)
    if other is None:
        return f"{_shown(one)} is in {_written(its)}, where an angle or a ratio is needed{named}"
    return (
        f"{_shown(one)} is in {_written(its)}, and {_shown(other)} in"
        f" {_written(theirs)}; what is added or compared must have one dimension{named}"
    )


def _shown(node: ast.expr) -> str:
    return repr(_ABOUT.sub(r"angle_about(\1, \2)", ast.unparse(node))[:60])


def _stated(tree: ast.AST, units: Mapping[str, str]) -> str:
    """The parameters of an expression, with their units."""
    names = _named(tree, units)
    return f" ({', '.join(f'parameters.{name}.unit: {units[name]}' for name in names)})" if names else ""


def _named(tree: ast.AST, units: Mapping[str, str]) -> list[str]:
    """The parameters with a unit that an expression names."""
    return list(dict.fromkeys(n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and n.id in units))


def _written(powers: Powers) -> str:
    """A dimension as a unit."""
    if powers == NONE:
        return "rad or 1"
    parts = [name if n == 1 else f"{name}^{n:g}" for name, n in zip(SI, powers, strict=True) if n]
    return "*".join(parts)
