"""Whatever numbers a scene is given: refused in one line, or run to an outcome that can be reported."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rungwise as rw
from rungwise.plain import json_text
from rungwise.simulation.options import ModelError
from rungwise.simulation.run import Simulation
from rungwise.world.planar.description import describe, described

from .conftest import MOVING

SCENES = {name: rw.load(name).file.model_dump(mode="json", exclude_none=True) for name in rw.shipped()}
EXTREME = st.sampled_from([0.0, -1.0, 5e-324, 1e-300, 1e-12, 1e12, 1e150, 1e300, -1e300])
TIMED = st.sampled_from(
    [
        "t",
        "1 / t",
        "1 / (t - 0.01)",
        "sqrt(0.01 - t)",
        "exp(1000 * t)",
        "1e308 * t",
        "inf",
        "0 / 0",
        "1e200**2",
    ]
)
OPTIONS = st.fixed_dictionaries(
    {"theta": st.sampled_from([0.5, 0.75, 1.0])},
    optional={
        "step": EXTREME.filter(lambda x: x > 0.0),
        "tol": EXTREME.filter(lambda x: x > 0.0),
        "duration": EXTREME.filter(lambda x: x > 0.0),
        "frames": st.sampled_from([3, 4, 100]),
    },
)
TEXTS = ("name", "kind", "role", "unit", "about")


def numbers(part: Any) -> list[tuple[Any, Any]]:
    """(container, key) of every number or expression inside."""
    keys = list(part) if isinstance(part, dict) else range(len(part)) if isinstance(part, list) else []
    found = []
    for key in keys:
        value = part[key]
        if isinstance(value, float) or (isinstance(value, str) and key not in TEXTS):
            found.append((part, key))
        found += numbers(value)
    return found


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
@settings(deadline=None, derandomize=True, max_examples=30, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_changed_numbers(name: str, data: st.DataObject) -> None:
    content = copy.deepcopy(SCENES[name])
    for _ in range(data.draw(st.integers(1, 3))):
        container, key = data.draw(st.sampled_from(numbers(content)))
        scaled = st.just(container[key]).map(lambda x: 1.5 * x if isinstance(x, float) else f"2 * ({x})")
        container[key] = data.draw(scaled | EXTREME | TIMED)
    try:
        scene = rw.load(content)
        described(describe(scene, scene.parameters()))
        model, options = data.draw(st.sampled_from(MOVING)), data.draw(OPTIONS)
        simulation = Simulation(scene, model, **options)
    except (rw.SceneError, ModelError) as error:
        assert str(error).isprintable() and 0 < len(str(error)) < 1000
        return
    simulation.advance(5)
    run = simulation.result()
    summary = json.loads(json_text(run.summary()))
    assert summary["outcome"] in {str(outcome) for outcome in rw.OUTCOMES.values()}
    assert run.reason.isprintable() and run.reason
    assert math.isfinite(run.time) and math.isfinite(run.worst_residual)
    assert all(math.isfinite(x) for body in run.final.values() for x in body.values())
