"""Plans that succeed at a rate that is asked for, in the mode of execution that measures least."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rungwise.planning.execution.guards import guarded
from rungwise.planning.execution.verify import verify
from rungwise.planning.motion.budget import Budget
from rungwise.planning.plan import GUARDED, OPEN_LOOP, RE_PLANNING, Check, Plan


def made_robust(
    plan: Plan, rate: float, samples: int, threads: int | None, tell: Callable[[str], None], budget: Budget
) -> Plan:  # fmt: skip
    """The plan with the mode in which the lower bound of its rate of success (95 %) is at least `rate`:
    open loop if that suffices, else with guarded moves, else re-planning; without one, a reason says so.
    It ends when the time of the budget is over, with the checks that were made.

    Each mode has samples of its own."""
    checks = list[Check]()
    for number, mode in enumerate((OPEN_LOOP, GUARDED, RE_PLANNING)):
        candidate = guarded(plan) if mode == GUARDED else plan
        if candidate is None:
            continue
        tell(f"{plan.stage}: {mode}, {samples} samples")
        found = verify(
            candidate, samples=samples, mode=mode, rate=rate, seed=plan.seed + number, threads=threads,
            limit=budget.seconds, on_progress=budget.announce,
        )  # fmt: skip
        checks.append(Check(mode, found.samples, found.successes, found.lower))
        if found.lower >= rate:
            return replace(candidate, checks=tuple(checks))
        if not budget.is_in_time():
            reason = f"robust: {budget.ended}; {mode}, {found.unfinished or 'the rate is not reached'}"
            return replace(plan, checks=tuple(checks), reason=f"{reason}; the plan holds on {plan.stage}")
    reason = f"robust: no mode of execution succeeds at a rate of {rate:g}; it holds without errors"
    return replace(plan, checks=tuple(checks), reason=reason)
