"""Plans that are followed from measured places: what a policy gives, what it says, and when it plans anew."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.execution.policy import FOLLOWING, LOST, RE_PROPOSING, adequate
from rungwise.planning.execution.receding import RecedingLegs
from rungwise.planning.execution.timed import Timed
from rungwise.planning.motion.budget import Stage
from rungwise.scene.scene import LIBRARY
from rungwise.world.find import world_of
from rungwise.world.nearest import apart
from rungwise.world.planar.surroundings import PlanarSurroundings
from tests.planning.members import unnamed_hand

PLANS = {
    "card": {},
    "corner_pivot": {},
    "push": {"task_seed": 1001, "schedule": "quasistatic"},
    "floor_push": {},
}
"""Plans by contact modes, of pushes, and in space."""


@cache
def planned(name: str) -> rw.Plan:
    found = rw.plan(name, seed=1, **PLANS[name])
    assert found.found, found.reason
    return found


@cache
def policy_of(name: str) -> rw.Policy:
    return planned(name).policy()


@cache
def in_haste(name: str) -> rw.Policy:
    return planned(name).policy(budget=500, limit=0.3)


def run(policy: rw.Policy, **options: object) -> rw.Run | rw.SpaceRun:
    plan = policy.plan
    assert plan.stage is not None
    policy.restart()
    given = {"parameters": plan.parameters, "tol": plan.tol, "duration": policy.duration, "inputs": []}
    return rw.simulate(plan.scene, plan.stage.model, control=policy, rate=policy.rate, **(given | options))


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["card", "push", "corner_pivot", "floor_push"])
def test_a_plan_is_followed_as_it_is_where_nothing_differs(name: str) -> None:
    """Nothing is proposed anew, and the run comes to the goal when the plan does."""
    policy = policy_of(name)
    found = run(policy)
    assert found.outcome == rw.Outcome.GOAL and not policy.proposals and policy.status == FOLLOWING
    assert found.time == pytest.approx(policy.plan.replay().time, rel=0.03)


@pytest.mark.long
@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("name", ["card", "push", "floor_push"])
def test_whatever_is_measured_a_policy_gives_inputs_and_says_what_it_does(name: str, number: int) -> None:
    """States about the plan's, some far off, some overlapping, some at other times, some not finite."""
    policy, rng = in_haste(name), np.random.default_rng(number)
    plan = policy.plan
    states = plan.replay().states
    low, high = (
        np.array([plan.scene.file.parameters[n].range[k] for n in plan.scene.template.inputs]) for k in (0, 1)
    )
    policy.restart()
    for _ in range(3):
        state = states[int(rng.integers(len(states)))]
        far = 10.0 ** rng.uniform(-5.0, 0.5)
        q = state.q + far * rng.standard_normal(len(state.q))
        if rng.random() < 0.1:
            q[int(rng.integers(len(q)))] = rng.choice([np.nan, np.inf])
        v = state.v + far * rng.standard_normal(len(state.v))
        given = policy(rw.State(state.names, q, v, state.time * rng.uniform(0.9, 1.2)))
        levels = np.array([given[n] for n in plan.scene.template.inputs])
        assert (low <= levels).all() and (levels <= high).all()
        assert policy.status in (FOLLOWING, RE_PROPOSING, LOST)
        assert bool(policy.reason) or policy.status == FOLLOWING


MEASURED = {
    **{name: partial(planned, name) for name in PLANS},
    "a hand of joined links": lambda: plan_of_a_hand(1),
    "four fingers": lambda: plan_of_four_fingers(),
}
"""Plans of pushes, hands and arms, in the plane and in space."""


@pytest.mark.few(1)
@pytest.mark.parametrize("number", range(10))
@pytest.mark.parametrize("name", MEASURED)
def test_no_measured_place_is_lost(name: str, number: int) -> None:
    """With errors between 1e-12 and 1e-2 of the size, in all places."""
    plan, rng = MEASURED[name](), np.random.default_rng(number)
    policy, states = plan.policy(), plan.replay().states
    moved = world_of(plan.scene).at(plan.parameters).moved
    weights = np.where(moved.weights > 0.0, moved.weights, 1.0)
    for _ in range(4):
        state, error = states[int(rng.integers(len(states)))], 10.0 ** rng.uniform(-12.0, -2.0)
        q = state.q + error * moved.size / weights * rng.uniform(-1.0, 1.0, len(state.q))
        policy.restart()
        found = policy._measured(q, state.v, state.q)
        assert np.isfinite(found.q).all()


def test_what_is_no_number_is_lost_and_inputs_stay() -> None:
    policy = policy_of("card")
    policy.restart()
    start = rw.State.of(policy.plan.scene)
    before = policy(start)
    q = start.q.copy()
    q[0] = np.nan
    assert policy(rw.State(start.names, q, start.v)) == before
    assert policy.status == LOST and policy.reason == "what is measured is not finite"


@pytest.mark.long
def test_a_policy_that_finds_nothing_tries_ever_more_rarely(monkeypatch: pytest.MonkeyPatch) -> None:
    """The box is seen to lie elsewhere for as long as a policy may take, and no search finds anything."""
    policy = policy_of("push").plan.policy()
    monkeypatch.setattr(type(policy._rest), "anew", lambda *_: None)
    plan, times = policy.plan, list[float]()
    start, x = rw.State.of(plan.scene, parameters=plan.parameters), policy.plan.scene.template.coordinates
    q = start.q.copy()
    q[x.index("box.x")] += 0.02
    policy.restart()
    for time in np.arange(0.0, policy.duration, 0.02 * plan.duration):
        before = len(policy.proposals)
        policy(rw.State(start.names, q, start.v, float(time)))
        times += [float(time)] * (len(policy.proposals) - before)
    waits = np.diff(times)[1:]  # the first is for the end of the plan
    assert policy.status == LOST and not any(each.found for each in policy.proposals)
    assert len(waits) >= 4 and (waits[1:] > 1.5 * waits[:-1]).all()


@pytest.mark.parametrize(
    ("seen", "said"),
    [(3.0, "takes an observation, a state or a simulation, not float"), ("push", "not of card")],
)
def test_what_is_no_state_of_the_scene_is_refused_in_a_line(seen: object, said: str) -> None:
    given = rw.State.of(seen) if isinstance(seen, str) else seen
    with pytest.raises(rw.TaskError, match=said):
        policy_of("card")(given)  # type: ignore[arg-type]


def test_a_box_that_lies_elsewhere_is_brought_to_the_goal() -> None:
    """By 4 mm: as it is the plan misses. Its policy does not, by steps of a user's own loop, either."""
    policy = policy_of("push")
    plan, there = policy.plan, policy.plan.parameters | {"x": 0.002, "y": -0.003}
    assert plan.stage is not None
    blind = rw.simulate(plan.scene, plan.stage.model, parameters=there, inputs=plan.segments, tol=plan.tol)
    assert blind.outcome == rw.Outcome.MISSED
    assert run(policy, parameters=there).outcome == rw.Outcome.GOAL
    assert any(each.found and each.steps > 0 for each in policy.proposals)
    policy.restart()
    simulation = rw.Simulation(
        plan.scene, plan.stage.model, parameters=there, tol=plan.tol, duration=policy.duration
    )
    while simulation.running:
        simulation.step(1.0 / policy.rate, policy(simulation), ramp=policy.ramp)
    assert simulation.outcome == rw.Outcome.GOAL


@pytest.mark.long
def test_a_goal_between_narrow_bounds_is_reached_from_elsewhere() -> None:
    """No place is a fifth within such bounds, so that plan and policy keep less of a reserve."""
    goal = "box.x >= goal_x - 0.002 and box.x <= goal_x + 0.002 and abs(box.y - goal_y) <= 0.005"
    scene = rw.load("push").changed(goal=goal)
    plan = rw.plan(scene, seed=1, task_seed=1001, schedule="quasistatic")
    assert plan.found, plan.reason
    policy = plan.policy()
    assert run(policy, parameters=plan.parameters | {"x": 0.002, "y": -0.003}).outcome == rw.Outcome.GOAL
    assert policy.proposals


def plan_of_a_hand(seed: int) -> rw.Plan:
    """A plan of a planar hand of joined links, whose disc may lie `aside`."""
    data = unnamed_hand(0.8, 40).file.model_dump(mode="json", exclude_unset=True)
    data["parameters"]["aside"] = {"default": 0.0, "range": [-1.0, 1.0]}
    data["bodies"]["disc"]["pose"]["x"] = "aside"
    return rw.plan(rw.load(data), schedule=[("quasistatic-compliant", 1e-2)], seed=seed)


@pytest.mark.long
def test_legs_of_fingers_that_the_task_does_not_name_are_proposed_anew() -> None:
    plan = plan_of_a_hand(0)
    assert "follow" in plan.labels
    elsewhere = plan.parameters | {"aside": 0.005}
    policy = plan.policy()
    run = rw.simulate(
        plan.scene, "quasistatic-compliant", parameters=elsewhere, tol=plan.tol, control=policy,
        rate=policy.rate, duration=policy.duration,
    )  # fmt: skip
    assert run.outcome == rw.Outcome.GOAL and not all(each.kept for each in policy.proposals)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [1, 2])
def test_hands_of_joined_links_go_on_from_what_is_measured(seed: int) -> None:
    """Joints of a run are open by its errors, and closing them lets links overlap what they touch."""
    plan = plan_of_a_hand(seed)
    policy = plan.policy()
    for aside in (0.002, -0.005):
        policy.restart()
        run = rw.simulate(
            plan.scene, "quasistatic-compliant", parameters=plan.parameters | {"aside": aside}, tol=plan.tol,
            control=policy, rate=policy.rate, duration=policy.duration,
        )  # fmt: skip
        assert run.outcome == rw.Outcome.GOAL, policy.reason


@cache
def plan_of_four_fingers() -> rw.Plan:
    """A plan of a hand that turns a ball in its palm a little; the ball may lie `aside`."""
    data = rw.load("hand_turn").file.model_dump(mode="json", exclude_unset=True)
    data["model"]["file"] = str(LIBRARY / "space" / data["model"]["file"])
    data["parameters"]["aside"] = {"default": 0.0, "range": [-1.0, 1.0]}
    data["start"]["places"] = {"ball.x": "aside"}
    parameters = {"turn": 30.0, "aligned": 0.05}
    found = rw.plan(rw.load(data), schedule=[("dynamic-compliant", 1e-2)], seed=0, parameters=parameters)
    assert found.found, found.reason
    return found


def led_by_hand(aside: float) -> tuple[rw.Policy, rw.SpaceRun]:
    plan = plan_of_four_fingers()
    policy = plan.policy()
    run = rw.simulate(
        plan.scene, "dynamic-compliant", parameters=plan.parameters | {"aside": aside}, tol=plan.tol,
        control=policy, rate=policy.rate, duration=policy.duration,
    )  # fmt: skip
    return policy, run


@pytest.mark.long
def test_fingers_keep_to_a_ball_that_lies_aside_without_any_proposal() -> None:
    plan = plan_of_four_fingers()
    policy, run = led_by_hand(0.003)
    assert run.outcome == rw.Outcome.GOAL and not policy.proposals
    told = [segment.inputs for segment in run.inputs]
    asked = [segment.inputs for segment in plan.segments]
    assert max(abs(told[-1][name] - asked[-1][name]) for name in asked[-1]) > 0.01


@pytest.mark.long
def test_an_object_is_not_moved_to_close_contacts_of_fingers_around_it() -> None:
    """It stays where it is measured, but for overlaps; and joints stay in their ranges."""
    plan = plan_of_four_fingers()
    policy, states = plan.policy(), plan.replay().states
    names = list(plan.scene.template.coordinates)
    ball = [names.index(f"ball.{axis}") for axis in "xyz"]
    seen = states[36].q.copy()
    seen[ball[1]] += 0.002
    seen[[name.endswith("_root") for name in names]] -= 0.06
    seen[names.index("first_base.first_aside")] = 0.55
    found = policy._measured(seen.copy(), states[36].v, states[36].q)
    assert np.linalg.norm(found.q[0, ball] - seen[ball]) < 0.0025
    assert found.q[0, names.index("first_base.first_aside")] <= 0.5


def test_a_block_that_leans_is_not_laid_flat_by_its_measurement() -> None:
    """Both corners are within the gap that counts as closed where it is expected, and one is open there."""
    policy = policy_of("corner_pivot")
    q = rw.State.of(policy.plan.scene).q.copy()
    q[3:] += np.array([-0.05, 2.25e-5, 5e-4])
    policy.restart()
    seen = q - np.array([0.0, 0.0, 0.0, 0.0, 1e-5, 0.0])
    found = policy._measured(seen, np.zeros(len(policy.plan.scene.template.velocities)), q)
    assert found.q[0] == pytest.approx(q, abs=2e-5)


def leaning(raised: float) -> tuple[rw.Policy, rw.State]:
    """A policy of two fingers, and a state where the box of the floor leans on one of them, or lies on it
    above the floor."""
    policy, lean = planned("floor_push").policy(model=rw.DYNAMIC_COMPLIANT), np.radians(15.0)
    names = list(policy.plan.scene.template.coordinates)
    turned = np.array([[np.cos(lean), np.sin(lean)], [-np.sin(lean), np.cos(lean)]])
    box = np.array([0.0, -(turned @ [0.06, -0.04])[1]])
    tip = box + turned @ [-0.06 - 0.012, 0.0]
    q = rw.State.of(policy.plan.scene).q.copy()
    placed = {
        "box.z": box[1] + raised, "box.qw": np.cos(0.5 * lean), "box.qy": np.sin(0.5 * lean),
        "finger0.x0": tip[0] + 0.2, "finger0.z0": tip[1] - 0.1 + raised,
    }  # fmt: skip
    q[[names.index(each) for each in placed]] = list(placed.values())
    levels = dict.fromkeys(policy.plan.scene.template.inputs, 0.0)
    levels |= {"x0": placed["finger0.x0"] + 2.5e-3, "z0": placed["finger0.z0"]}
    policy._levels = np.array(list(levels.values()))
    return policy, rw.State(tuple(names), q, np.zeros(len(policy.plan.scene.template.velocities)))


@pytest.mark.long
@pytest.mark.parametrize("raised", [0.0, 0.1])
def test_fingers_let_go_where_nothing_leads_on_unless_the_object_falls_far(
    raised: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A box that leans on a finger comes to lie flat, and all legs are left; one that is held up stays."""
    policy, state = leaning(raised)
    names = list(state.names)
    monkeypatch.setattr(policy, "_kept", lambda *_: None)
    monkeypatch.setattr(RecedingLegs, "_led", lambda *_: None)
    moves = len(policy.plan.moves)
    policy(state)
    assert policy.status == (LOST if raised else RE_PROPOSING), policy.reason
    if raised:
        return
    part, upright = policy._now, [names.index("box.qx"), names.index("box.qy")]
    assert {"leave", "hold"} <= set(part.labels) <= {"leave", "hold", "wait"}
    assert np.abs(part.path[-1][upright]).max() < 1e-3
    assert len(policy._rest._left) == moves + 1
    policy._rest.leave(1, part.labels)
    assert len(policy._rest._left) == moves


def test_the_cheapest_rung_from_which_a_plan_held_is_adequate() -> None:
    plan = planned("push")
    assert (
        adequate(plan) == Stage(rw.QUASISTATIC_RIGID, 1e-3)
        and policy_of("push").model == rw.QUASISTATIC_RIGID
    )
    assert plan.policy(model="dynamic-rigid").model == rw.DYNAMIC_RIGID


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"budget": 0}, "budget: must be"),
        ({"average": 0}, "average: must be"),
        ({"limit": -1.0}, "limit: must be"),
        ({"model": "geometric"}, "geometric"),
    ],
)
def test_wrong_options_of_a_policy_are_named(given: dict[str, float], said: str) -> None:
    with pytest.raises(rw.InputError, match=said):
        planned("card").policy(**given)


def test_a_proposal_takes_no_more_than_its_budget() -> None:
    """Runs that began are ended: no more than a leg is run after the budget is spent."""
    policy = planned("push").policy(budget=100)
    found = run(policy, parameters=policy.plan.parameters | {"x": 0.002, "y": -0.003})
    assert found.outcome in (rw.Outcome.GOAL, rw.Outcome.MISSED, rw.Outcome.TIMEOUT)
    assert policy.proposals and max(each.steps for each in policy.proposals) < 20_000


def two_ramps() -> Timed:
    rows = np.array([[0.0], [1.0], [1.0], [3.0]])
    ends, path = np.array([0.0, 2.0, 3.0, 4.0]), np.array([[0.0], [4.0]])
    legs = np.array([0, 0, 1])
    return Timed(rows, (True, False, False), ends, legs, ("a", "b", "c"), np.zeros(1), path, ends[[0, 2]])


def test_inputs_over_time_have_means_and_rests() -> None:
    part = two_ramps()
    assert part.at(1.0) == [0.5] and part.at(2.5) == [1.0] and part.at(3.5) == [3.0] and part.at(9.0) == [0.0]
    assert part.mean(0.0, 2.0) == pytest.approx([0.5]) and part.mean(1.0, 4.5) == pytest.approx([4.75 / 3.5])
    assert part.expected(1.5) == pytest.approx([2.0]) and part.expected(9.0) == [4.0]
    assert part.is_known(3.0) and not part.is_known(3.1)
    segments, labels, legs = part.left(1.5, ["u"])
    assert [each.duration for each in segments] == [0.5, 1.0, 1.0] and labels == ("a", "b", "c")
    assert segments[0].ramp and segments[0].inputs == {"u": 1.0} and legs.tolist() == [0, 0, 1]


@pytest.mark.few(2)
@pytest.mark.parametrize("number", range(8))
def test_measured_contacts_are_closed_and_overlaps_opened(number: int) -> None:
    """A block in a corner, measured with errors of up to a millimetre."""
    scene = rw.load("corner_pivot")
    around, rng = PlanarSurroundings(scene, scene.parameters()), np.random.default_rng(number)
    start = rw.State.of(scene).q
    pairs = np.unique(around.touches(start, 1e-4).pairs)
    q = start.copy()
    q[3:] += rng.uniform(-1.0, 1.0, 3) * np.array([1e-3, 1e-3, 1e-2])
    found = apart(around, q, 4e-3, pairs)
    least = around.touches(found, 1e-2).least
    assert least.min() >= 0.0 and least[pairs].max() <= 4e-6 and np.abs(found - q).max() <= 0.03


@pytest.mark.long
def test_feedback_is_verified_beside_the_other_modes() -> None:
    plan = planned("push")
    blind, seeing = (rw.verify(plan, samples=3, mode=mode, seed=3) for mode in ("open loop", "feedback"))
    assert seeing.successes >= blind.successes and seeing.successes >= 2
    assert seeing.mode == "feedback" and seeing.lower > 0.0 and "feedback: " in str(seeing)
    noisy = rw.verify(plan, samples=1, mode="feedback", noise=5e-4)
    assert noisy.noise == 5e-4 and noisy.samples == 1
    with pytest.raises(rw.InputError, match="noise: must be a finite number that is not below 0"):
        rw.verify(plan, samples=1, mode="feedback", noise=-1.0)
