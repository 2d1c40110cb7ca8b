"""Compile and keep the kernels of runs, before many processes need them at once.

    python -m rungwise.compilation

Begins each shipped scene on each rung, at fixed and at controlled steps, alone and in a batch.
"""

from __future__ import annotations

import importlib
import time

import numpy as np

from rungwise.compilation.cache import cache_folder
from rungwise.compilation.progress import compiling


def main() -> None:
    package = importlib.import_module("rungwise")
    began = time.perf_counter()
    models = [model for model in package.LADDER if model.moves]
    for name in package.shipped():
        scene = package.load(name)
        for model in models:
            for tol in (None, 1e-2):
                package.Simulation(scene, model, tol=tol).advance()
            names = tuple(scene.file.parameters)[:1]
            defaults = [[scene.file.parameters[name].default for name in names]]
            package.Batch(scene, model, names, duration=1e-3, threads=1).run(np.array(defaults))
    took = time.perf_counter() - began
    where = cache_folder("rungwise.simulation.planar.loop").parent
    print(f"rungwise: {compiling.kernels} kernels compiled in {took:.0f} s, kept in {where}")


if __name__ == "__main__":
    main()
