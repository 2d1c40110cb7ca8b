"""Which members of a class of tests are quick.

`@pytest.mark.few(n)`: of a parametrized test, n members run in `make test`, and all others are long. They are
spread over the members, and over the values of each parameter. Those that are named on the command line run.
"""

from __future__ import annotations

from collections import Counter, defaultdict

import pytest

_GOLDEN = 0.6180339887498949


def spread(members: list[pytest.Function], count: int) -> list[pytest.Function]:
    """That many of the members: each has the values that were chosen least often so far."""
    far = [i for _, i in sorted((i * _GOLDEN % 1.0, i) for i in range(len(members)))]
    left, chosen = [members[i] for i in far], []
    seen: Counter[tuple[str, str]] = Counter()
    for _ in range(min(count, len(left))):
        best = min(left, key=lambda member: sum(seen[value] for value in values_of(member)))
        left.remove(best)
        chosen.append(best)
        seen.update(values_of(best))
    return chosen


def values_of(member: pytest.Function) -> list[tuple[str, str]]:
    return [(name, repr(value)) for name, value in member.callspec.params.items()]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    classes: dict[tuple[object, str], list[pytest.Function]] = defaultdict(list)
    for item in items:
        if isinstance(item, pytest.Function) and item.get_closest_marker("few"):
            classes[item.parent, item.originalname].append(item)
    for members in classes.values():
        mark = members[0].get_closest_marker("few")
        assert mark is not None
        quick = spread(members, *mark.args)
        for member in members:
            if member not in quick:
                member.add_marker("long")
