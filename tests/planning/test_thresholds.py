"""Numbers that plans are judged by, from both sides."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.design import design
from rungwise.planning.design.optimise import Tuner
from rungwise.planning.lift import lift, repair
from rungwise.planning.modes.forces.cones import SLIDE, balances, memory_for, nonnegative
from rungwise.planning.modes.forces.mode_motions import projected, turn
from rungwise.planning.modes.tried import _at_speeds
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.joint_transit import SpaceTransit
from rungwise.planning.motion.placements import Placing
from rungwise.planning.search.problem import Work
from rungwise.planning.squeeze import squeeze_plan
from rungwise.planning.task.task import Task, _is_slow
from rungwise.world.planar.evidence import _bounce, _giving
from rungwise.world.spatial.around.surface import BOX, CAPSULE, ELLIPSOID, SPHERE, _is_inside
from rungwise.world.spatial.tool import JointTool


def stub(**members: Any) -> Any:
    return SimpleNamespace(**members)


def test_angles_are_the_same_up_to_a_billionth() -> None:
    for off, period in ((1e-10, math.pi / 2.0), (2e-8, math.pi)):
        square = [[0.0, 0.0], [1.0, 0.0], [1.0 + off, 1.0], [0.0, 1.0]]
        assert squeeze_plan(square).function.period == pytest.approx(period)


def test_a_plan_that_lacks_a_billionth_lacks_nothing() -> None:
    for lack, was_there in ((1e-10, True), (1e-8, False)):
        work = stub(was_there=False, nearest=math.inf, nearest_at=None)
        Work.came_near(work, lack, np.zeros(1))
        assert work.was_there == was_there and (work.nearest == lack) == (not was_there)


def test_inputs_keep_their_bounds_up_to_a_billionth_of_them() -> None:
    task = stub(low=np.array([-1.0]), high=np.array([1.0]))
    assert Task.allows(task, np.array([[1.0 + 2e-10], [1.0 + 2e-8]])).tolist() == [True, False]


def test_pushes_are_slow_where_objects_coast_by_less_than_a_hundredth_of_their_size() -> None:
    for speed, is_slow in ((0.06, True), (0.3, False)):
        carriers: Any = (stub(by_place=False, speed=speed),)
        assert _is_slow(np.ones(1), carriers, 1.0) == is_slow


def test_coordinates_that_hardly_move_have_no_part_in_a_certificate() -> None:
    for share, names in ((1e-7, ["a"]), (1e-5, ["a", "b"])):
        run = stub(
            certificate=stub(vectors=[np.array([1.0, share])]), problem=stub(c=np.zeros(2)),
            workspace=stub(state=stub(free=np.arange(2))),
            scene=stub(template=stub(coordinates=("a", "b"))),
        )  # fmt: skip
        assert _giving(run) == names


def test_objects_rest_below_a_hundredth_of_the_robots_speed_and_are_waited_for_ten_pushes() -> None:
    carrier: Any = stub(speed=0.5, push=(0.1, 2.0))
    task = stub(_speeds=[0.5], carriers=(carrier,), size=1.0)
    still: Any = Task.still
    patience: Any = Task.patience
    assert still.fget(task) == pytest.approx(0.005) and patience.fget(task) == pytest.approx(40.0)


MEMORY = memory_for(2, 1, 2, 3, 3)


def balanced(off: float) -> bool:
    """Whether an edge that pushes upwards balances a weight that is off by so much."""
    MEMORY.edges[0] = (0.0, 1.0, 0.0)
    return bool(balances(1, 0, np.array([off, -1.0, 0.0]), 1.0, np.zeros(2), MEMORY))


def left_by(columns: list[list[float]], wanted: list[float]) -> tuple[float, float]:
    """How far two columns, or one, stay from what is wanted, and the share of the first."""
    m = len(columns)
    MEMORY.columns[:m, :2], MEMORY.wanted[:2] = columns, wanted
    return float(nonnegative(m, 2, MEMORY)), float(MEMORY.share[0])


def slides_on(tilt: float) -> bool:
    """Whether two contacts, of which one is tilted by so much, keep an object from sliding."""
    MEMORY.normals[0], MEMORY.normals[1], motion = (1.0, 0.0, 0.0), (1.0, tilt, 0.0), np.empty(3)
    projected(np.array([SLIDE, SLIDE]), np.array([0.0, 1.0, 0.0]), motion, MEMORY)
    return bool(abs(motion[1]) > 0.5)


def moves_aside(tilt: float) -> bool:
    """Whether a support with two rows, one tilted by so much, takes the tilt for a way to move."""
    turn(np.array([[1.0, 0.0, 0.0], [1.0, tilt, 0.0]]), MEMORY)
    return bool(MEMORY.turned[1, 1] > 1.0)


@pytest.mark.parametrize(
    ("holds", "within", "beyond"),
    [
        (balanced, 2e-7, 2e-5),
        (lambda e: left_by([[-1.0, 0.0], [1.0, e]], [0.0, 1.0])[0] > 0.5, 1e-8, 1e-6),
        (lambda e: left_by([[1.0, 0.0]], [e, 1.0])[1] == 0.0, 1e-12, 1e-10),
        (slides_on, 1e-8, 1e-6),
        (lambda e: not moves_aside(e), 1e-7, 1e-5),
    ],
    ids=["balance", "edges that are one", "edges that do not help", "contacts that are one", "supports"],
)
def test_modes_turn_between(holds: Callable[[float], bool], within: float, beyond: float) -> None:
    assert holds(within) and not holds(beyond)


def test_a_finger_pushes_alone_in_a_fifth_of_the_draws() -> None:
    """Where another one could push beside it."""
    rng, alone = np.random.default_rng(0), 0
    for _ in range(400):
        own = np.ones(2, np.int64)
        _at_speeds(own.copy(), np.zeros(2, np.int64), own, np.zeros(2, np.int64), rng)
        alone += int(own.sum() == 1)
    assert 40 < alone < 160


@pytest.mark.parametrize(("off", "found"), [(0.0, True), (0.15, True), (0.4, False)])
def test_a_search_about_a_design_of_another_rung_stays_near_it(off: float, found: bool) -> None:
    """Of four numbers, each of which may be off by 0.15; far away, this search is none of its business."""
    tuner: Any = object.__new__(Tuner)
    tuner.box, tuner.names, tuner.quantiles, tuner.count = np.array([[0.0, 1.0]] * 4), "abcd", [0.0], 0
    rounds = list[Reals]()

    def tried(designs: Reals, _quantiles: Any = None) -> tuple[Reals, Reals]:
        rounds.append(designs)
        short = np.abs(designs - (0.5 + off)).max(axis=1) - 0.15
        return (short <= 0.0).astype(float), np.zeros(len(designs))

    tuner.tried = tried
    rate = design._found(tuner, 0.02, 10_000, True, np.random.default_rng(0), np.full(4, 0.5))[3]
    assert (rate > 0.0) == found and 0.05 < np.abs(rounds[0] - 0.5).std() < 0.2


class _Line:
    """A body that moves by 1 along a line, beside one that stands, both a half thick; `spins`: its marks are
    angles, of which a whole turn is none."""

    def __init__(self, gap: Callable[[Reals], Reals], holds: Any = None, spins: bool = False) -> None:
        self.asked, self._gap, self._holds = 0, gap, holds
        self.room = stub(
            pairs=np.array([[0, 1]]), thin=0.5, size=1.0, changed=lambda x, change: x + change, unit=1.0,
            moved=lambda marks: np.column_stack([self._ways(marks, spins), np.zeros(len(marks) - 1)]),
        )  # fmt: skip

    def _ways(self, marks: Reals, spins: bool) -> Reals:
        ways = np.diff(marks)
        return np.abs(ways - np.round(ways) if spins else ways)

    def _asked(self, _a: Reals, _b: Reals, at: Reals) -> Any:
        self.asked += len(at)
        unsafe = np.zeros(len(at), bool) if self._holds is None else self._holds(at)
        lacks = np.full(len(at), np.inf if self._holds is None else 10.0)
        return self._gap(at)[:, None], at, lacks, (self._gap(at) < 0.0) | unsafe

    def is_free(self) -> bool:
        own: Any = self
        return Placing.is_free(own, np.zeros(1), np.ones(1))


def test_posts_are_seen_that_are_thin_beside_the_thinnest_shape() -> None:
    """And where bodies graze each other, looks end."""
    for at in np.linspace(0.2, 0.8, 31).tolist():
        assert not _Line(lambda x, at=at: np.abs(x - at) - 5e-4).is_free()
    grazing = _Line(lambda x: np.full(len(x), 1e-6))
    assert grazing.is_free() and grazing.asked < 5000


def test_what_is_unsafe_is_seen_where_it_is_a_tenth_as_wide_as_the_thinnest_shape() -> None:
    for at in np.linspace(0.2, 0.8, 31).tolist():
        own = _Line(lambda x: np.full(len(x), 9.0), lambda x, at=at: np.abs(x - at) < 0.03)
        assert not own.is_free()
    safe = _Line(lambda x: np.full(len(x), 9.0), lambda x: np.zeros(len(x), bool))
    assert safe.is_free() and safe.asked < 100


def test_a_whole_turn_is_a_way() -> None:
    assert not _Line(lambda x: np.abs(x - 0.4) - 0.1, spins=True).is_free()


def test_steps_to_the_bounds_of_a_goal_come_there() -> None:
    """In spite of rounding: |x - a| - b is not 0 at a + b."""
    middles, bounds = np.random.default_rng(0).uniform(0.5, 3.0, (2, 300))

    def lacks(x: Reals, _apart: bool) -> Reals:
        a, b = (np.tile(each, len(x) // len(each))[:, None] for each in (middles, bounds))
        return np.maximum(np.abs(x - a) - b, 0.0)

    own: Any = stub(
        _slopes=lambda x, lack, _apart: (lack > 0.0)[:, :, None] * np.ones((len(x), 1, 1)), _lacks=lacks,
        _stopped=lambda x, _step: np.zeros(x.shape, bool), _within=lambda x: x,
        room=stub(changed=lambda x, change: x + change, unit=1.0),
    )  # fmt: skip
    x = (middles + bounds)[:, None] + 0.7
    lack = lacks(x, False)
    for _ in range(4):
        x, lack = Placing._stepped(own, x, lack, False)
    assert not lack.any()


@pytest.mark.parametrize(("off", "fits"), [(0.1, True), (0.6, False)])
def test_a_tool_keeps_its_clearance_nearly(off: float, fits: bool) -> None:
    """From above or below."""
    away = np.array([0.0, 0.0, 1.0])
    for clearance, sign in ((0.01, 1.0), (2.0, -1.0)):
        gap = clearance * (1.0 + sign * off)
        own: Any = stub(
            led=lambda q, _aim: q, _far=lambda _target: 0.0, _place=lambda _q: None,
            _nearest=lambda _target, gap=gap: (gap, away, np.zeros(3)), _middle=lambda: np.zeros(3),
            _slope=lambda _at: np.eye(3), _step=lambda *_: False, carrier=stub(clearance=clearance, lean=0.1),
        )  # fmt: skip
        assert (JointTool.beside(own, np.zeros(3), 0, np.zeros(3), away) is not None) == fits


@pytest.mark.parametrize(("near", "bounced"), [(3e-4, True), (4e-3, False)])
def test_bodies_bounce_off_each_other_where_they_met(near: float, bounced: bool) -> None:
    """Two that come to a gap of such a part of the size, and part again."""
    for size in (0.1, 3.0):
        gap = size * (near + np.abs(np.arange(-3.0, 4.0)))[:, None]
        data = xr.Dataset({"gap": (("time", "contact"), gap)}, coords={"contact": ["a|b"]})
        motion = stub(data=data, times=np.arange(7.0))
        parting: Any = stub(motions=(motion, motion), size=size, time=9.0)
        assert bool(_bounce(parting)) == bounced


@pytest.mark.parametrize("count", [20, 200])
def test_the_margin_of_designs_is_that_of_a_tenth_of_the_samples(count: int) -> None:
    """Neither that of the worst one, which is chance, nor of a middle one."""
    margins = np.random.default_rng(0).permutation(np.arange(float(count)))
    found = stub(outcome=np.full(count, Code.GOAL), margin=margins)
    own: Any = stub(
        quantiles=None, _worlds=lambda _design, _quantiles: np.zeros((count, 1)), count=0,
        outcomes=Counter[str](), on_progress=None, time=stub(deadline=None, look=None),
        _batch=stub(run=lambda *_, **__: found),
    )  # fmt: skip
    rates, least = Tuner.tried(own, np.zeros((1, 1)))
    assert rates.tolist() == [1.0]
    assert max(1, 0.02 * count) <= least[0] + 1 <= 0.3 * count


def _geom(kind: int, size: tuple[float, float, float]) -> Any:
    bound = float(np.linalg.norm(size))
    return stub(
        geom_quat=np.array([[1.0, 0.0, 0.0, 0.0]]), geom_size=np.array([size]), geom_type=np.array([kind]),
        geom_pos=np.zeros((1, 3)), geom_rbound=np.array([bound]),
    )  # fmt: skip


@pytest.mark.parametrize("kind", [SPHERE, CAPSULE, ELLIPSOID, BOX, 5])
def test_places_on_a_geom_are_inside_of_it_but_for_rounding(kind: int) -> None:
    """Beyond its end along an axis by less than a millionth of its size, or by more."""
    for scale in (0.01, 5.0):
        size = (scale, scale, scale)
        model = _geom(kind, size)
        end = 2.0 * scale if kind == CAPSULE else scale
        for off, within in ((2e-7, True), (1e-5, False)):
            place = np.array([[0.0, 0.0, end * (1.0 + off)]])
            assert bool(_is_inside(model, 0, place)[0]) == within


@pytest.mark.parametrize("heading", np.linspace(0.1, 6.0, 7).tolist())
def test_a_robot_comes_away_though_few_ways_lead_away(heading: float) -> None:
    """Within an eighth of a turn about a heading."""
    way = np.array([math.cos(heading), math.sin(heading)])

    def gaps(rows: Reals) -> Reals:
        ahead = rows @ way
        aside = np.abs(rows @ np.array([-way[1], way[0]]))
        return (0.1 * np.where(aside <= 0.41 * ahead, ahead, -1.0))[:, None]

    own: Any = stub(
        _gaps=gaps, _clearance=0.5, _columns=np.arange(2), _limits=(np.full(2, -9.0), np.full(2, 9.0)),
        _moved=lambda a, b: float(np.linalg.norm(b - a)),
    )  # fmt: skip
    found = SpaceTransit.away(own, np.zeros(2))
    assert found @ way > 0.0 and np.linalg.norm(found) <= 1.0 + 1e-9


def test_hands_grasp_anew_in_most_of_the_time_and_leave_some_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    parts, before = list[float](), stub(is_by_modes=False, vectors=np.zeros((2, 1)))

    @contextmanager
    def part(share: float) -> Any:
        parts.append(share)
        yield

    monkeypatch.setattr(repair, "hand_in", lambda _: stub())
    monkeypatch.setattr(repair, "by_hand", lambda *_: None)
    work: Any = stub(budget=stub(part=part))
    assert repair._regrasped(work, stub(), before) is None
    assert 0.5 <= parts[0] <= 0.9


def test_plans_are_led_to_inertia_by_steps_of_a_decade_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    inertias = list[float]()
    monkeypatch.setattr(repair, "laid", lambda _work, own, _vectors: own)
    predictor = stub(stage=Stage(rw.DYNAMIC_RIGID, 1e-3))

    def of(stage: Any) -> Any:
        inertias.append(stage.model.inertia)
        return stub(reached=True, places=[], stage=stage)

    work: Any = stub(predictor=of, budget=stub(left=True))
    before: Any = stub(model=rw.QUASISTATIC_RIGID, vectors=np.zeros((0, 1)), waypoints=None)
    assert repair._by_continuation(work, predictor, before) is not None
    grown = np.array([0.001, *inertias]) / rw.DYNAMIC_RIGID.inertia
    assert grown[-1] == 1.0 and (np.diff(grown) > 0.0).all() and (grown[1:] / grown[:-1] < 12.0).all()


def test_designs_may_drift_while_nearly_all_still_succeeds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate that falls by chance in a few of a hundred samples is the same; one that falls by a tenth is
    not."""
    asked = list[float]()
    for name, found in (
        ("searched_earlier", (None, ())), ("_found", (np.ones(1), "", 0.1, 0.8)), ("_rate", 0.8),
    ):  # fmt: skip
        monkeypatch.setattr(design, name, lambda *_, found=found: found)
    monkeypatch.setattr(design, "_confirmed", lambda *given: asked.append(given[3]))
    rw.design("two_finger", ("v1",), box={"v1": (0.2, 2.2)}, model="quasistatic-rigid", threads=1)
    assert 0.9 * 0.8 < asked[0] < 0.995 * 0.8


@pytest.mark.parametrize(
    ("without", "moves", "is_left"), [(5, 5, True), (6, 6, False), (6, 12, True), (9, 12, False)]
)
@pytest.mark.parametrize("code", [Code.NOT_CONVERGED, Code.UNSUPPORTED, Code.MODEL_INVALID])
def test_a_stage_on_which_most_moves_end_without_a_verdict_is_given_up(
    without: int, moves: int, is_left: bool, code: Code
) -> None:
    stage, budget = Stage(rw.QUASISTATIC_RIGID, 1e-3), Budget()
    others = [Code.MISSED] * (moves - without)
    with budget.part(1.0, stage):
        budget.take(stage, 1, np.array([*others, *([code] * without)]))
        assert budget.left == is_left
    assert budget.left
    with budget.part(1.0, Stage(rw.DYNAMIC_COMPLIANT, 1e-3)):
        assert budget.left


@pytest.mark.long
@pytest.mark.parametrize("name", ["floor_push", "push"])
def test_no_stage_is_given_up_but_those_before_the_last_where_modes_lead_fingers(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = dict[str, str]()

    def taken(work: Work, before: rw.Plan, stage: Stage, _anew: bool = True) -> rw.Plan:
        work.budget.take(stage, 1, np.full(10, Code.UNSUPPORTED))
        ended.setdefault(stage.model.name, work.budget.ended)
        return before

    monkeypatch.setattr(lift, "_take_stage", taken)
    rw.plan(name, seed=0, budget=1000, schedule=["quasistatic-rigid", "dynamic-compliant"])
    given_up = "most moves end without a verdict" if name == "floor_push" else ""
    assert ended == {"quasistatic-rigid": given_up, "dynamic-compliant": ""}
