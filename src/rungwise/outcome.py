"""Every way a run can end: code, exit code and advice, in one table.

Kernels return the codes; people read the texts.
"""

from __future__ import annotations

from enum import IntEnum, StrEnum


class Code(IntEnum):
    """Outcome of a run. Only `RUNNING` is not final."""

    RUNNING = 0
    GOAL = 1
    UNSAFE = 2
    DOOMED = 3
    JAMMED = 4
    UNSUPPORTED = 5
    MISSED = 6
    TIMEOUT = 7
    MODEL_INVALID = 8
    INVALID = 9
    NOT_CONVERGED = 10


class Outcome(StrEnum):
    """How a run ended: a text (`run.outcome == "goal"`), with its `code`, what it means, and advice.

    `exit_code` is the exit code of the command line: 0 the answer is positive, 1 negative or open, 2 bad
    input. Whatever Ctrl-C ends exits with 130.
    """

    code: Code
    exit_code: int
    meaning: str
    advice: str

    RUNNING = (
        Code.RUNNING,
        1,
        "the run was interrupted, or its limit in seconds was over",
        "Continue it, or run it again.",
    )
    GOAL = Code.GOAL, 0, "the goal condition holds", "Try it on the next rung, if there is one."
    UNSAFE = Code.UNSAFE, 1, "an unsafe condition holds", "Change inputs or design, or relax the condition."
    DOOMED = (
        Code.DOOMED,
        1,
        "the scene's rule says that no input can reach the goal from here",
        "Change the inputs that led here; the doomed set (the paper's Z_A) begins before this state.",
    )
    JAMMED = (
        Code.JAMMED,
        1,
        "no motion satisfies contact, friction and the prescribed speeds",
        "Use a force-limited servo, a compliant rung, or lower friction; see the certificate.",
    )
    UNSUPPORTED = (
        Code.UNSUPPORTED,
        1,
        "contacts and drives cannot balance the loads without inertia",
        "Use a dynamic rung, or support the body.",
    )
    MISSED = (
        Code.MISSED,
        1,
        "the inputs are spent and the goal is not reached",
        "Change the inputs or the start.",
    )
    TIMEOUT = (
        Code.TIMEOUT,
        1,
        "the time is over, and no condition of the scene has decided the run",
        "Give more time (--time), or state a goal.",
    )
    MODEL_INVALID = (
        Code.MODEL_INVALID,
        1,
        "a local deformation outgrew the feature that carries it",
        "The compliant model no longer holds here: raise stiffness, lower loads, or use a rigid rung.",
    )
    INVALID = (
        Code.INVALID,
        2,
        "the scene is impossible at these parameters",
        "See the reason; `rungwise check` shows parameters and their ranges.",
    )
    NOT_CONVERGED = (
        Code.NOT_CONVERGED,
        1,
        "no solver brought the step's residual below tolerance, and no certificate says why",
        "Try another rung, or a smaller step; --save-hard DIR keeps the problem for `rungwise solve`.",
    )

    def __new__(cls, code: Code, exit_code: int, meaning: str, advice: str) -> Outcome:
        text = code.name.lower()
        outcome = str.__new__(cls, text)
        outcome._value_ = text
        outcome.code, outcome.exit_code, outcome.meaning, outcome.advice = code, exit_code, meaning, advice
        return outcome

    @property
    def name(self) -> str:
        return self.value


OUTCOMES: dict[Code, Outcome] = {outcome.code: outcome for outcome in Outcome}
