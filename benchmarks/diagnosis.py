"""Does the diagnosis name the ingredient that was changed? A confusion matrix over random pushes.

    python benchmarks/diagnosis.py [--cases 20] [--seed 0]

Each case draws a push (the scene `push`: box, contact, friction, speed) and changes one ingredient so that it
matters: contact friction, restitution, inertia, the give of contacts, or the support. The others change, too,
but by next to nothing: the quasistatic rung becomes the dynamic one for a slow push, rigid contacts become
stiff ones, friction changes by a part in 10 000. Mixed cases change two so that they matter, null cases none.
Cases whose motions differ by less than twice the threshold of the diagnosis are drawn again. A mixed case is
right if the diagnosis names both ingredients, or the one of them that closes the gap alone.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable

import numpy as np

import rungwise as rw
from rungwise.planning.diagnosis.diagnose import APART, CLOSES, NOTHING

Change = tuple[dict[str, float], dict[str, float], str, str]
SINGLES = ("friction", "support", "compliance", "inertia", "restitution")


def base(rng: np.random.Generator) -> dict[str, float]:
    """A push, slow or fast."""
    return {
        "offset": float(rng.uniform(-0.03, 0.03)),
        "mu": float(rng.uniform(0.1, 0.6)), "mu_s": float(rng.uniform(0.2, 0.6)),
        "angle": float(rng.uniform(-0.5, 0.5)), "width": float(rng.uniform(0.07, 0.14)),
        "height": float(rng.uniform(0.07, 0.14)), "mass": float(rng.uniform(0.3, 3.0)), "travel": 0.12,
    }  # fmt: skip


SLOW, FAST = (-3.0, -2.0), (-0.5, 0.0)
STIFF = {"stiffness": 1e7, "damping": 6e3}
Q, D, C = "quasistatic-rigid", "dynamic-rigid", "dynamic-compliant"


def at(rng: np.random.Generator, speeds: tuple[float, float]) -> dict[str, float]:
    """A push at a speed between these powers of ten, with stiff contacts."""
    return base(rng) | STIFF | {"v": float(10.0 ** rng.uniform(*speeds))}


def faint(p: dict[str, float]) -> dict[str, float]:
    """The same push with friction changed by next to nothing."""
    return p | {"mu": p["mu"] * 1.0001}


def friction(rng: np.random.Generator) -> Change:
    p = at(rng, SLOW)
    return p, p | {"mu": float(rng.choice([0.0, p["mu"] * 0.3, p["mu"] * 3.0]))}, Q, C


def support(rng: np.random.Generator) -> Change:
    if rng.random() < 0.5:
        p = at(rng, FAST)
        return p, faint(p) | {"mu_s": p["mu_s"] * float(rng.choice([0.3, 3.0]))}, D, D
    p = at(rng, SLOW)
    pressed = {"press_x": float(rng.uniform(0.01, 0.03)), "press_y": float(rng.uniform(-0.03, 0.03))}
    return p, faint(p) | pressed, Q, C


def compliance(rng: np.random.Generator) -> Change:
    p = at(rng, SLOW) | {"stiffness": float(10.0 ** rng.uniform(2.3, 3.0)), "damping": 1.0}
    return p, faint(p), Q, C


def inertia(rng: np.random.Generator) -> Change:
    p = at(rng, FAST)
    return p, faint(p), Q, C if rng.random() < 0.5 else D


def restitution(rng: np.random.Generator) -> Change:
    p = at(rng, FAST)
    return p, faint(p) | {"restitution": float(rng.uniform(0.3, 0.9)), "mu_s": p["mu_s"] * 1.0001}, D, D


def null(rng: np.random.Generator) -> Change:
    p = at(rng, SLOW)
    return p, faint(p), Q, C if rng.random() < 0.5 else D


def mixed(rng: np.random.Generator) -> Change:
    p = at(rng, FAST)
    return p, p | {"mu": p["mu"] * float(rng.choice([0.2, 3.0]))}, Q, C if rng.random() < 0.5 else D


def diagnosis(change: Change) -> rw.Diagnosis:
    before, after, one, other = change
    scale = 0.12 / before["v"]
    inputs = [rw.Segment({"ux": 1.0, "uy": 0.0}, scale), rw.Segment({"ux": 0.0, "uy": 0.0}, max(1.0, scale))]
    return rw.diagnose(PUSH, one, other, inputs=inputs, parameters=before, other_parameters=after)


PUSH = rw.load("push")
KINDS: dict[str, Callable[[np.random.Generator], Change]] = {
    "friction": friction, "support": support, "compliance": compliance, "inertia": inertia,
    "restitution": restitution, "mixed": mixed, "null": null,
}  # fmt: skip


def answer(kind: str, found: rw.Diagnosis) -> str:
    """What the diagnosis names: an ingredient, "mixed", "null"; a mixed case is also answered by the one of
    its ingredients that closes the gap alone."""
    if found.cause == NOTHING:
        return "null"
    if kind == "mixed" and set(found.causes) <= {"friction", "inertia"}:
        enough = all(found.left[cause] <= CLOSES for cause in found.causes) or len(found.causes) == 2
        return "mixed" if enough else found.cause
    return found.cause if len(found.causes) == 1 else "mixed"


def size(p: dict[str, float]) -> float:
    """How far the box reaches from its centre."""
    return float(np.hypot(p["width"], p["height"]) / 2.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng, columns = np.random.default_rng(given.seed), [*SINGLES, "mixed", "null"]
    print(f"{'':12}" + "".join(f"{name:>12}" for name in [*columns, "other"]) + f"{'redrawn':>12}")
    right = total = 0
    for kind, draw in KINDS.items():
        answers, redrawn = Counter[str](), 0
        while answers.total() < given.cases:
            change = draw(rng)
            found = diagnosis(change)
            if kind != "null" and found.distance < 2.0 * APART * size(change[1]):
                redrawn += 1
                continue
            answers[answer(kind, found)] += 1
        others = sum(count for name, count in answers.items() if name not in columns)
        print(
            f"{kind:12}" + "".join(f"{answers[name]:12}" for name in columns) + f"{others:12}{redrawn:12}",
            flush=True,
        )
        right, total = right + answers[kind], total + given.cases
    print(f"on the diagonal: {right} of {total}")


if __name__ == "__main__":
    main()
