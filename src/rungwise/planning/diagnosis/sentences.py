"""Causes of a diagnosis in words, with their numbers, and how runs ended.

A cause without numbers, or one that is new, is said by its phrase in `WORDS` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rungwise.world.ingredients import (
    ACCURACY,
    BALANCE,
    COMPLIANCE,
    FRICTION,
    INERTIA,
    OTHER,
    RESTITUTION,
    SUPPORT,
)

UNTOUCHED = "untouched"
WORDS = {
    UNTOUCHED: "a body moved without being touched",
    BALANCE: "another motion was admissible",
    FRICTION: "a contact slid, stuck or broke instead",
    SUPPORT: "friction with the support differs",
    COMPLIANCE: "bodies sank into each other",
    INERTIA: "bodies coasted on their momentum",
    RESTITUTION: "bodies bounced after an impact",
    ACCURACY: "steps were too coarse",
    OTHER: "bodies, places or drives differ",
}
"""Each cause as a phrase."""
MODES = {"open": "was open", "stick": "stuck", "forward": "slid", "backward": "slid", "slip": "slid"}
"""Modes of a contact, as it is told what happened."""


class Told(NamedTuple):
    """What a sentence tells: the numbers of a cause (see `world.ingredients`), on what the first and the
    second run were ("on kinematic"), and the body that parts."""

    numbers: Mapping[str, Any]
    on: tuple[str, str]
    body: str


def sentence(cause: str, told: Told) -> str:
    """The cause with its numbers, where it has any."""
    say = _SENTENCES.get(cause)
    return say(told) if say is not None and told.numbers else WORDS.get(cause, cause)


def ending(end: Mapping[str, Any], on: str) -> str:
    """How a run ended, and the contacts and coordinates of the certificate that proves a jam or a missing
    support."""
    said = f"{on} the run ends at t = {end['time']:.4g}, {end['outcome']}"
    proof = end.get("certificate")
    if proof is None:
        return said
    contacts = ", ".join(proof["contacts"])
    match proof["kind"]:
        case "unsupported":
            said += f": nothing balances the loads along {', '.join(proof['coordinates'])}"
        case "unbalanced":
            at = f" at the contacts {contacts}" if contacts else ""
            said += f": no motion balances the loads without inertia{at}"
        case _:
            said += f": no motion satisfies these contacts together: {contacts}"
    return f"{said} ({proof['kind']} certificate)"


def places(before: str, after: str) -> tuple[str, str]:
    """Names of the two runs in sentences: their rungs, with the accuracy where both are on the same, and
    their order where that is the same, too."""
    if before == after:
        return "in the first", "in the second"
    one, other = (name.split(" @ ")[0] for name in (before, after))
    return (f"on {before}", f"on {after}") if one == other else (f"on {one}", f"on {other}")


def _untouched(told: Told) -> str:
    n, on = told.numbers, told.on
    others = "".join(f", {name} {_alone(numbers)}" for name, numbers in n.get("others", {}).items())
    return f"{told.body} moved {_alone(n)} {on[0]} without being touched by a robot{others}"


def _alone(numbers: Mapping[str, Any]) -> str:
    part = f" (but for {numbers['touched']:.3g})" if numbers["touched"] > 0.0 else ""
    return f"{numbers['moved']:.3g}{part}"


def _balance(told: Told) -> str:
    (one, other), on, body = told.numbers["speed"], told.on, told.body
    said = f"another motion was admissible: {body} moves at {one:.3g} {on[0]}, at {other:.3g} {on[1]}"
    weights = told.numbers.get("weight", (0.0, 0.0))
    if (weights[0] > 0.0) != (weights[1] > 0.0):
        said += f"; {on[int(weights[1] == 0.0)]} its weight of {max(weights):.3g} is left out"
    for pairs, where in zip(told.numbers.get("alone", ()), on, strict=False):
        said += f"; {', '.join(pairs)} touch{'es' * (len(pairs) == 1)} only {where}" if pairs else ""
    return said


def _friction(told: Told) -> str:
    n, on = told.numbers, told.on
    one, other = (MODES[mode] for mode in n["modes"])
    if one == other and (0.0 in n["friction"] or n["modes"][0] == n["modes"][1]):
        mu = [f"{value:.3g} {where}" for value, where in zip(n["friction"], on, strict=True)]
        return f"{n['contact']} {one} in both, with friction {mu[0]}, {mu[1]}"
    again = " the other way" if one == other else ""
    return f"{n['contact']} {one} {on[0]}, {other}{again} {on[1]}, from t = {n['since']:.4g} on"


def _support(told: Told) -> str:
    changes = ", ".join(f"{name} {one:.3g} -> {other:.3g}" for name, (one, other) in told.numbers.items())
    return f"friction with the support of {told.body} differs: {changes}"


def _compliance(told: Told) -> str:
    n, on = told.numbers, told.on
    deepest, _, where = max(zip(n["overlap"], n["yields"], on, strict=True))
    said = f"contacts yield {where}"
    if deepest > 0.0:
        said = f"bodies sank into each other {where}: {n['contact']} by {deepest:.3g}"
    return said if all(n["yields"]) else f"{said}, and cannot {on[n['yields'].index(False)]}"


def _inertia(told: Told) -> str:
    n = told.numbers
    which = int(n["energy"][1] > n["energy"][0])
    way = n["coasted"][which]
    did = f"coasted {way:.3g} on its momentum" if way > 0.0 else "had momentum, but never coasted freely"
    return f"{told.body} {did} {told.on[which]} (kinetic energy at most {n['energy'][which]:.3g})"


def _restitution(told: Told) -> str:
    n = told.numbers
    met = f"met at {n['met']:.3g} and " if "met" in n else ""
    return (
        f"bodies bounced after an impact {told.on[n['run']]}: {n['contact']} {met}separated at"
        f" {n['left']:.3g} at t = {n['time']:.4g}"
    )


def _accuracy(told: Told) -> str:
    (one, other), on = told.numbers["tol"], told.on
    return f"steps were too coarse: errors of {one:.2g} per step {on[0]}, of {other:.2g} {on[1]}"


def _others(told: Told) -> str:
    changes = ", ".join(f"{name} {one:.4g} -> {other:.4g}" for name, (one, other) in told.numbers.items())
    return f"bodies, places or drives differ: {changes}"


_SENTENCES: dict[str, Callable[[Told], str]] = {
    UNTOUCHED: _untouched, BALANCE: _balance, FRICTION: _friction, SUPPORT: _support,
    COMPLIANCE: _compliance, INERTIA: _inertia, RESTITUTION: _restitution, ACCURACY: _accuracy,
    OTHER: _others,
}  # fmt: skip
