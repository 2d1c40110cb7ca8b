"""Bodies of MuJoCo in the loop of a run: its kernels are those of any system of kernels."""

from __future__ import annotations

from rungwise.simulation.stepping.loop import (
    advance_loop,
    keep_loop,
    see_state,
    spent_loop,
    take_back_loop,
)
from rungwise.system import contract
from rungwise.system.spatial.mechanism import Mechanism

contract.take_step.given_by(Mechanism)(advance_loop)
contract.see.given_by(Mechanism)(see_state)
contract.keep_run.given_by(Mechanism)(keep_loop)
contract.take_back_run.given_by(Mechanism)(take_back_loop)
contract.spent.given_by(Mechanism)(spent_loop)
