"""Numbers that answers are accepted by, from both sides: a start is left alone iff it is good enough."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw


@pytest.mark.parametrize(("error", "kept"), [(5e-10, True), (2e-9, False)])
def test_a_start_is_an_answer_up_to_an_error_of_a_billionth(error: float, kept: bool) -> None:
    found = rw.solve(rw.Problem.lcp(np.array([[2.0]]), np.array([-2.0])), start=np.array([1.0 + error]))
    assert found.status == "solved" and (found.chain == ()) == kept
