"""Recipes of CONTRIBUTING that are followed from outside: each takes one file, and an entry of a list."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.planning.lift import repair
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import Predictor
from rungwise.planning.search import search
from rungwise.planning.search.problem import Work
from rungwise.planning.search.search import Begun
from rungwise.planning.search.shooting import run_moves
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.moving import Moment
from rungwise.system.terms import Terms
from tests.simulation.core.test_particle import Particle

# A scene: one file, found by its name where scenes are kept, or by its path.

_SLED = """
name: sled
about: A sled that slides on level ground until friction has stopped it.
parameters:
  pace: {default: 2.0, range: [0.1, 10.0], unit: m/s, about: speed at the start}
  mu: {default: 0.25, range: [0.01, 1.0], unit: "1", about: friction of the ground}
gravity: [0, -10]
bodies:
  sled:
    role: object
    shape: {kind: box, width: 1.0, height: 0.2}
    density: 1.0
    pose: {x: 0.0, y: 0.1, angle: 0.0}
    motion: {kind: free}
    coordinates: {x: {speed: pace}}
  ground: {role: obstacle, shape: {kind: halfplane, normal: [0, 1]}}
contacts:
  - {between: [sled, ground], friction: mu, stiffness: 1.0e+6, damping: 1.0e+3}
tolerance: 1.0e-6
duration: 0.15 * pace / mu
step: 1.0e-3
"""


@pytest.mark.parametrize("by_name", [True, False])
def test_a_scene(by_name: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "sled.yaml"
    file.write_text(_SLED)
    if by_name:
        monkeypatch.setattr("rungwise.scene.scene.LIBRARY", tmp_path)
    run = rw.simulate("sled" if by_name else str(file), model="dynamic-rigid", parameters={"pace": 1.0})
    assert float(run.trajectory.position.sel(coordinate="sled.x")[-1]) == pytest.approx(1.0 / 5.0, rel=5e-3)


# An ingredient of contact: where a system fills its terms. Here adhesion: a contact pulls within a range with
# a force, as in Dugdale's law, and friction knows the pull.


@dataclass
class Adhesive(Particle):
    """Pulls towards the floor with `pull` where the gap is below `range`."""

    pull: float = 1.0
    range: float = 1e-4

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Any, Any]:
        found = super().fill(moment, terms, reach)
        if self.least_gap(moment.q) < self.range:
            terms.load[1] -= self.pull
        return found


@pytest.mark.parametrize("part", [0.9, 1.1])
@pytest.mark.parametrize(
    "rung", [each for each in rw.LADDER if each.moves and each.loads], ids=lambda each: each.name
)
def test_an_ingredient_of_contact(rung: Rung, part: float) -> None:
    """A ball on a ceiling, upside down, stays as long as its weight is below the pull."""
    weight, pull, drag = part * 2.0, 2.0, 10.0
    ball = Adhesive((0.0, 0.0), load=(0.0, weight), pull=pull, drag=drag, friction=0.5)
    stepper = Stepper(ball, rung, 1e-3)
    stepper.run(0.05)
    if part < 1.0:
        assert abs(stepper.q[1]) <= pull / ball.stiffness
    else:
        assert stepper.q[1] > ball.range
        if rung.inertia == 0.0:
            assert stepper.v[1] == pytest.approx(weight / drag)


@pytest.mark.parametrize("side", [0.9, 1.1])
def test_friction_of_an_adhesive_contact_knows_the_pull(side: float) -> None:
    ball = Adhesive(load=(side * 0.5 * 2.0, 0.0), pull=2.0, friction=0.5)
    stepper = Stepper(ball, rw.DYNAMIC_RIGID, 1e-3)
    stepper.run(0.01)
    assert (stepper.v[0] == pytest.approx(0.0, abs=1e-9)) == (side < 1.0)


# A law of contact that scenes name: one file, and its name in the list of laws. Here magnets, whose pull
# falls with the gap. The package is copied, and its kernels are plain Python.

_MAGNET = '''
"""Magnets: each point of contact pulls with a force that falls to nothing as its gap grows to the range."""

from typing import ClassVar

from rungwise.kernel import Record, inner_kernel
from rungwise.scene.fields.laws.law import Carried, Law, Lawful
from rungwise.scene.fields.values import Number


@inner_kernel
def pull(contact: Record, gap: float, _pushed: bool) -> float:
    return float(contact.magnet * max(0.0, 1.0 - max(0.0, gap) / contact.magnet_range))


@inner_kernel
def reach(contact: Record) -> float:
    return float(contact.magnet_range)


class Magnet(Lawful):
    """See the module."""

    magnet: Number | None = None
    magnet_range: Number = 0.01

    law: ClassVar[Law] = Law(
        title="magnet",
        about="magnet, magnet_range: pull at no gap, and the gap at which there is none.",
        numbers=(
            Carried("magnet", lambda _contact, _tolerance: 0.0),
            Carried("magnet_range", lambda _contact, _tolerance: 0.01, above=0.0),
        ),
        pull=pull,
        reach=reach,
    )
'''

_HANGS = """
import rungwise as rw
from rungwise.world.find import world_of

def ends(gap, model, **laws):
    s = rw.SceneBuilder("magnet", gravity=[0, -10], goal="body.y <= -1", duration=0.6, step=1e-3)
    up = rw.parts.slide([0, 1], name="y")
    s.body("body", "object", rw.parts.disc(0.1), pose=(0, -0.1 - gap), mass=1.0, motion=up)
    s.body("ceiling", "obstacle", rw.parts.halfplane([0, -1]))
    s.contact("body", "ceiling", stiffness=1e6, damping=1e3, **laws)
    scene = s.load()
    world = world_of(scene)
    assert ("magnet 30" in world.described(world.describe(scene.parameters()))) == bool(laws)
    return str(rw.simulate(scene, model).outcome)

print(rw.__file__)
for model in ("dynamic-rigid", "dynamic-compliant"):
    print(ends(0.005, model, magnet=30.0), ends(0.008, model, magnet=30.0), ends(0.005, model))
"""


def test_a_law_of_contact(tmp_path: Path) -> None:
    """A body jumps up to the ceiling from where the pull is above its weight, and falls from below."""
    package = tmp_path / "rungwise"
    shutil.copytree(Path(rw.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__", "*.xml"))
    laws = package / "scene" / "fields" / "laws"
    (laws / "magnet.py").write_text(_MAGNET, "utf-8")
    text = (laws / "contact.py").read_text("utf-8")
    text = text.replace("class Named(\n", "class Named(\n    Magnet,\n")
    first = "from rungwise.scene.fields.laws.law import"
    own = "from rungwise.scene.fields.laws.magnet import Magnet\n"
    (laws / "contact.py").write_text(text.replace(first, f"{own}{first}", 1), "utf-8")
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", _HANGS], env=environment, cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert str(package) in done.stdout
    assert done.stdout.split("\n")[1:] == ["timeout goal goal"] * 2 + [""]


# A planner, and a repair: functions, and their places in PLANNERS and REPAIRS.


def _by_chance(work: Work, predictor: Predictor, begun: Begun, aim: Aim, _deepest: int) -> Iterator[Reals]:
    """Single moves that are drawn, of which those are yielded that come to their aim."""
    while work.budget.left:
        moves = work.rng.random((64, 1, work.moves.size))
        trials = run_moves(work.moves, predictor, begun.places, moves, aim, begun.levels)
        yield from trials.vectors[trials.reached > 0]


def test_a_planner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "PLANNERS", (_by_chance,))
    monkeypatch.setattr(search, "ROUNDS", 0)  # trees do not grow
    plans = [rw.plan("two_finger", from_="kinematic", to="kinematic", seed=3) for _ in range(2)]
    assert plans[0].found and plans[0].segments == plans[1].segments


@pytest.mark.parametrize("of_modes", [True, False])
def test_a_repair(of_modes: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A repair is asked for plans that it is for, where one does not hold, and named where it mends one."""
    mended: Any = object()
    own = repair.Repair(lambda _work, _predictor, _before: mended, "made again", of_modes=of_modes)
    monkeypatch.setattr(repair, "REPAIRS", (own,))
    monkeypatch.setattr(repair, "_held", lambda *_: None)
    work: Any = SimpleNamespace(predictor=lambda _: None, budget=SimpleNamespace(left=1))
    stage: Any = None
    for by_modes in (True, False):
        before: Any = SimpleNamespace(is_by_modes=by_modes)
        lifted = repair.on_stage(work, stage, before, anew=False)
        mends = of_modes or not by_modes
        assert lifted == ((mended, "made again") if mends else (None, "nothing found"))
