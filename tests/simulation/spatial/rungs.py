"""Rungs by what they know, for tests of many rungs."""

from __future__ import annotations

import rungwise as rw
from rungwise.models.ladder import Rung

MOVING = [rung for rung in rw.LADDER if rung.moves]
WITH_LOADS = [rung for rung in MOVING if rung.loads]
DYNAMIC = [rung for rung in MOVING if rung.inertia > 0.0]
QUASISTATIC = [rung for rung in WITH_LOADS if rung.inertia == 0.0]
RIGID = [rung for rung in WITH_LOADS if not rung.compliant]
COMPLIANT = [rung for rung in WITH_LOADS if rung.compliant]


def named(rung: Rung) -> str:
    return rung.name
