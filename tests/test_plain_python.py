"""Every kernel runs as plain Python, for a debugger or for coverage."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

import rungwise as rw

SHORT = """
import json, sys, rungwise as rw
runs = {}
for model in rw.LADDER[1:]:
    run = rw.simulate("two_finger_servo", model, step=0.02, duration=0.8)
    runs[model.name] = [str(run.outcome), run.steps, run.final["part"]["x3"]]
json.dump(runs, sys.stdout)
"""


def test_a_run_on_each_rung_is_the_same_without_compilation() -> None:
    plain = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore::RuntimeWarning", "-c", SHORT],
        env=plain,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    for name, (outcome, steps, place) in json.loads(done.stdout).items():
        run = rw.simulate("two_finger_servo", name, step=0.02, duration=0.8)
        assert (str(run.outcome), run.steps) == (outcome, steps)
        assert run.final["part"]["x3"] == pytest.approx(place, abs=1e-12)
