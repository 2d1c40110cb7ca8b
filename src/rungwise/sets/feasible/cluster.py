"""Runs of sets on the workers of a cluster."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from rungwise.cluster import Batch, Cluster
from rungwise.deadline import Deadline
from rungwise.kernel import Ints, Reals
from rungwise.scene import load
from rungwise.scene.contract import AnyScene
from rungwise.sets.feasible.oracle import InProcess, Runner
from rungwise.sets.motions import Motions
from rungwise.sets.request import batch_of
from rungwise.sets.store import SetError
from rungwise.simulation.options import moving_rung
from rungwise.world.find import world_of

KEPT_NOTE = "; with a folder for results, finished batches are kept, and it can be resumed"


@contextmanager
def runner(
    batch: Motions, address: str | None, scene: AnyScene, request: Mapping[str, Any], deadline: Deadline
) -> Iterator[Runner]:
    """The threads of this process, or the workers of the scheduler at an address."""
    if address is None:
        yield InProcess(batch, deadline)
        return
    if not world_of(scene).on_clusters:
        raise SetError(f"cluster: {scene.name} runs in threads of this machine")
    job = scene.file.model_dump_json(), json.dumps(dict(request))
    cluster = Cluster(address, batch_at, job, SetError, KEPT_NOTE)
    try:
        yield cluster
    finally:
        cluster.close()


def batch_at(scene: str, request: str) -> Batch:
    """On a worker: a batch in one thread, its kernels compiled."""
    asked = json.loads(request)
    rung = moving_rung(asked["model"])
    rung = rung if rung.metric else rung.with_inertia(asked["inertia"])
    batch = batch_of(load(json.loads(scene)), rung, asked["over"], asked, threads=1)
    batch.run(np.mean(asked["box"], axis=1)[None, :])

    def run(points: Reals) -> tuple[Ints, Reals]:
        found = batch.run(points)
        return found.outcome, found.margin

    return run
