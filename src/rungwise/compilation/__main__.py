"""Compile and keep kernels, before many processes need them at once.

    python -m rungwise.compilation [runs] [problems] [space] [answers] [sets]

Runs: begins each shipped scene on each rung, at fixed and controlled steps, alone and in a batch. Problems:
solves contact problems of each kind, small and large, in the plane and in space. Space: takes steps of scenes
in space on each rung, if MuJoCo is installed. Answers: asks of shipped scenes what the commands ask, plans,
diagnoses and comparisons, for some minutes. Sets: sets and designs. Without a name: all.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import time
from contextlib import suppress
from typing import Any

import numpy as np

from rungwise.compilation.cache import cache_folder
from rungwise.compilation.progress import compiling

PLAN_S = 10.0
"""Seconds after which a plan is given up: it has called by then what a plan calls. Chosen by trial."""


def main() -> None:
    """Compile what the command line names."""
    began = time.perf_counter()
    for name in sys.argv[1:] or _PARTS:
        _PARTS[name]()
    took, where = time.perf_counter() - began, cache_folder("rungwise.simulation.planar.loop").parent
    print(f"rungwise: {compiling.kernels} kernels compiled in {took:.0f} s, kept in {where}")


def _runs() -> None:
    package = importlib.import_module("rungwise")
    begun = importlib.import_module("rungwise.simulation.run").Simulation
    models = [model for model in package.LADDER if model.moves]
    for name in package.shipped():
        scene = package.load(name)
        for model in models:
            for tol in (None, 1e-2):
                begun(scene, model, tol=tol).advance()
            names = tuple(scene.file.parameters)[:1]
            defaults = [[scene.file.parameters[name].default for name in names]]
            package.Batch(scene, model, names, duration=1e-3, threads=1).run(np.array(defaults))
    crowd = package.load(_crowd())
    for model in models:
        begun(crowd, model).advance(3)


def _crowd() -> dict[str, Any]:
    """Boxes in two rows on the ground: more than are solved as few bodies are."""
    shape = {"kind": "box", "width": 0.9, "height": 1.0}
    bodies: dict[str, Any] = {
        f"box{i}": {
            "role": "object", "mass": 1.0, "shape": shape, "motion": {"kind": "free"},
            "pose": {"x": i % 12 + 0.4 * (i // 12), "y": 0.5 + i // 12},
        }
        for i in range(24)
    }  # fmt: skip
    bodies["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    law = {"friction": 0.5, "stiffness": 1e6, "damping": 1e4}
    return {
        "name": "crowd", "gravity": [0.0, -9.81], "bodies": bodies, "duration": 1.0, "step": 1e-3,
        "contacts": [{"between": ["box*", "box*"], **law}, {"between": ["box*", "ground"], **law}],
    }  # fmt: skip


def _problems() -> None:
    package, rng = importlib.import_module("rungwise"), np.random.default_rng(0)
    package.solve(package.Problem.lcp(np.eye(3), -np.ones(3)))
    for d in (1, 2, 3):
        for contacts in (2, 30):
            rows, n, mu = d * contacts, 3 * contacts, np.full(contacts, 0.5)
            G = rng.normal(size=(rows, rows // 2 + 1))
            package.solve(package.Problem.local(G @ G.T, G @ rng.normal(size=G.shape[1]), mu, d))
            mixed = package.Problem.balance(
                np.eye(n), rng.normal(size=n), rng.normal(size=(rows, n)), np.zeros(rows), mu, directions=d,
                S=rng.normal(size=(2, n)), w_s=np.zeros(2), F=np.array([0.5, np.inf]),
            )  # fmt: skip
            package.solve(mixed)


def _space() -> None:
    package = importlib.import_module("rungwise")
    if importlib.util.find_spec("mujoco") is None:
        return
    for name in ("slope", "stack", "pile", "peg", "three_finger_lift"):
        for model in package.LADDER:
            if model.moves:
                package.simulate(name, model, duration=0.01)


def _answers() -> None:
    package = importlib.import_module("rungwise")
    scenes = [*package.shipped(), *(package.shipped_in_space() if importlib.util.find_spec("mujoco") else ())]
    for name in scenes:
        for model in package.LADDER[1:]:
            with suppress(package.InputError):
                package.simulate(name, model, duration=0.05)
        for aim in (package.DYNAMIC_COMPLIANT, package.QUASISTATIC_RIGID):
            with suppress(package.InputError):
                package.plan(name, to=aim, limit=PLAN_S)
    package.diagnose("gripper", "kinematic", "quasistatic-rigid")
    package.to_html(package.simulate("gripper", package.DYNAMIC_RIGID))
    package.compare("two_finger", samples=1)


def _sets() -> None:
    package = importlib.import_module("rungwise")
    for model in package.LADDER[1:]:
        package.feasible_set("two_finger", model, ("v1", "v2"), tol=0.25)
        package.design("two_finger", ("v2",), model=model, box={"v2": (0.1, 0.4)}, budget=200)


_PARTS = {"runs": _runs, "problems": _problems, "space": _space, "answers": _answers, "sets": _sets}

if __name__ == "__main__":
    main()
