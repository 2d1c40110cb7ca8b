"""What came of the stages of a plan, row by row."""

from __future__ import annotations

from dataclasses import replace

from rungwise.planning.plan import NOTHING, Plan, Record


def with_record(plan: Plan, record: Record) -> Plan:
    """The plan with what came of a stage; what the same stage took before is added to it."""
    places = [each.stage for each in plan.records]
    if record.stage not in places:
        return replace(plan, records=(*plan.records, record))
    records, at = list(plan.records), places.index(record.stage)
    records[at] = _with_effort(record, [records[at]])
    return replace(plan, records=tuple(records))


def without_vain_repairs(plan: Plan) -> Plan:
    """The plan without the records, beyond its own stage, of repairs of other plans that found nothing; what
    these took is added to its stage."""
    names = [record.stage for record in plan.records]
    if str(plan.stage) not in names:
        return plan
    own = names.index(str(plan.stage))
    later = plan.records[own + 1 :]
    whole = _with_effort(plan.records[own], [record for record in later if record.how.startswith(NOTHING)])
    kept = [record for record in later if not record.how.startswith(NOTHING)]
    return replace(plan, records=(*plan.records[:own], whole, *kept))


def _with_effort(record: Record, others: list[Record]) -> Record:
    """The record with the steps and seconds of others added."""
    steps = record.steps + sum(each.steps for each in others)
    return replace(record, steps=steps, seconds=record.seconds + sum(each.seconds for each in others))
