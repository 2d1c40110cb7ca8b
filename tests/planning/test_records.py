"""What a plan says of its stages."""

from __future__ import annotations

from dataclasses import replace

import pytest

import rungwise as rw
from rungwise.planning.lift.records import with_record, without_vain_repairs
from rungwise.planning.plan import HELD, NOTHING, Record

LAST, FINER = rw.Stage(rw.DYNAMIC_COMPLIANT, 1e-3), rw.Stage(rw.DYNAMIC_COMPLIANT, 1e-4)


@pytest.mark.parametrize("how", [NOTHING, f"{NOTHING}; the limit is over"])
def test_a_plan_that_holds_lists_no_repair_that_found_nothing(how: str) -> None:
    """An earlier turn tried to repair another plan beyond the last stage; its steps are counted still."""
    scene = rw.load("two_finger")
    plan = rw.Plan(scene, scene.parameters(), stage=LAST)
    for record in (Record(str(LAST), "planned", 5, 1.0), Record(str(FINER), how, 7, 2.0)):
        plan = with_record(plan, record)
    plan = with_record(plan, Record(str(LAST), HELD, 11, 3.0))
    (row,) = without_vain_repairs(plan).records
    assert (row.stage, row.how, row.steps, row.seconds) == (str(LAST), HELD, 23, 6.0)
    repaired = replace(with_record(plan, Record(str(FINER), "repaired", 1, 1.0)), stage=FINER)
    assert [row.steps for row in without_vain_repairs(repaired).records] == [16, 8]
