"""Which contact keeps steps short, or ends a run, and why, in words (see `simulation.planar.step.blame`)."""

from __future__ import annotations

from dataclasses import dataclass

from rungwise.contact.step import TOLERANCE
from rungwise.kernel import RecordArray
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.scene.scene import Bound
from rungwise.simulation.core.crawl import (
    BENT,
    CAUSES,
    FAR,
    INSOLUBLE,
    MEETING,
    MISSING,
    OVERLAPPING,
    TORN,
    lead_nowhere,
    why_nowhere,
)

LONGER = {
    INSOLUBLE: "longer ones have no solution {at}",
    OVERLAPPING: "longer ones would overlap bodies {at}",
    TORN: "longer ones would open a rigid joint",
    MISSING: "longer ones would miss how contact changes {at}",
    MEETING: "bodies bounce {at}, and a step ends where they meet",
    FAR: "things move too far in longer ones for contacts to be followed",
    BENT: "the error of longer ones is above the one allowed",
}
"""What makes steps shorter, by cause."""
NONE = {
    OVERLAPPING: "each step, however short, would overlap bodies {at}: a singular position",
    TORN: "each step, however short, would open a rigid joint: a singular position",
    MISSING: "each step, however short, would miss how contact changes {at}",
}
"""Why no step can be taken, by cause."""
LEADING_ON = {
    "kinematic": "on quasistatic-rigid forces decide what moves",
    "quasistatic-rigid": "on dynamic-rigid momentum decides what balance leaves open, and on"
    " quasistatic-compliant contacts yield",
    "quasistatic-compliant": "on dynamic-compliant momentum decides what balance leaves open",
    "dynamic-rigid": "on dynamic-compliant contacts yield",
}
"""What leads on where a shorter step does not, by rung."""


@dataclass(frozen=True)
class Hindrance:
    """What `simulation.planar.step.blame` says of a run on a rung."""

    scene: Scene
    model: Rung
    bound: Bound
    control: RecordArray
    clock: RecordArray

    def why_short(self) -> str:
        """What most steps were shorter for, or else the last, as a clause; empty where no step was."""
        return self._clause("blamed" if self.clock[0]["votes"] > 0 else "refusal", LONGER)

    def why_ended(self, code: Code, fastest: str) -> str:
        """What a run lacks whose last step has neither a solution nor a proof, or whose steps led nowhere;
        `code` is what the loop took it for, `fastest` the coordinate that inertia alone would move."""
        clock, step = self.clock[0], float(self.control[0]["step"])
        count, span = int(clock["crowd"]), float(clock["time"] - clock["mark"])
        if lead_nowhere(count, span, step):
            return why_nowhere(count, span, step, self.why_short())
        why = self._clause("refusal", NONE) if clock["residual"] <= TOLERANCE else ""
        if code == Code.UNSUPPORTED:
            why = f"forces do not balance without inertia at {fastest}, and no certificate says why"
        elif not why:
            why = f"no step, however short, has a solution {self._at('refusal')}".strip()
        return f"{why} (residual {clock['residual']:.1e})"

    def advice(self) -> str:
        """What may lead on from there."""
        contact, controlled = self._contact("refusal"), self.control[0]["error"] > 0.0
        lines = ["A larger --tol may help." if controlled else "A smaller --step, or --tol, may help."]
        if self.model.name in LEADING_ON:
            leading = LEADING_ON[self.model.name]
            lines.append(f"If that changes nothing, for example because bodies are wedged, {leading}.")
        bounces = contact is not None and self.bound.records.contacts[contact]["restitution"] > 0.0
        if bounces and self.model.name == "dynamic-rigid":
            lines.append("With restitution 0 nothing bounces there.")
        lines.append("--save-hard DIR keeps the problem for `rungwise solve` and other solvers.")
        return " ".join(lines)

    def _clause(self, field: str, clauses: dict[int, str]) -> str:
        cause = int(self.clock[0][field]) % CAUSES
        return " ".join(clauses[cause].format(at=self._at(field)).split()) if cause in clauses else ""

    def _at(self, field: str) -> str:
        """Where: a contact with what it is like, or a travel limit."""
        slot, pairs = int(self.clock[0][field]) // CAUSES, 2 * len(self.bound.records.pairs)
        if int(self.clock[0][field]) % CAUSES not in LONGER or slot < 0:
            return ""
        contact = self._contact(field)
        if contact is None:
            coordinates, number = self.scene.template.coordinates, (slot - pairs) // 2
            return (
                f"at the limit of {coordinates[number]}"
                if number < len(coordinates)
                else "at a joint's limit"
            )
        a, b = self.scene.template.contacts[contact]
        here = self.bound.records.contacts[contact]
        told = [f"friction {here['friction']:.3g}"] if self.model.friction else []
        if self.model.name == "dynamic-rigid" and here["restitution"] > 0.0:
            told.append(f"restitution {here['restitution']:.3g}")
        return f"between {a} and {b}" + (f" ({', '.join(told)})" if told else "")

    def _contact(self, field: str) -> int | None:
        """The contact at fault, or None for a travel limit and where nothing is known."""
        slot = int(self.clock[0][field]) // CAUSES
        if not 0 <= slot < 2 * len(self.bound.records.pairs):
            return None
        return int(self.bound.records.pairs[slot // 2]["contact"])
