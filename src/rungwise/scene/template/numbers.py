"""Numbers of a scene: programs write them into the records' buffer, and their bounds are checked."""

from __future__ import annotations

import math

from rungwise.kernel import Reals, kernel
from rungwise.scene.errors import MAY_BE_INFINITE, STRICT
from rungwise.scene.language.expression import evaluate
from rungwise.scene.template.template import Bounds, Numbers


@kernel
def evaluate_numbers(numbers: Numbers, values: Reals, stack: Reals, buffer: Reals) -> int:
    """Run every program and store its value at its target; returns the first target whose value is not
    finite, or -1."""
    table, targets = numbers.table, numbers.targets
    wrong = -1
    for i in range(targets.shape[0]):
        value = evaluate(numbers.code, numbers.constants, table[i, 0], table[i, 1], values, stack)
        buffer[targets[i]] = value
        if wrong < 0 and not math.isfinite(value):
            wrong = targets[i]
    return wrong


@kernel
def out_of_bounds(bounds: Bounds, buffer: Reals) -> int:
    """Index of the first number outside its bounds, or -1."""
    low, high, kinds = bounds.low, bounds.high, bounds.kinds
    for i in range(bounds.slots.shape[0]):
        x = buffer[bounds.slots[i]]
        if math.isnan(x) or (math.isinf(x) and kinds[i] & MAY_BE_INFINITE == 0):
            return i
        if x < low[i] or x > high[i] or (x == low[i] and kinds[i] & STRICT != 0):
            return i
    return -1
