"""The checker of certificates for contacts of three directions, where a cone has pieces: see `farkas`."""

from __future__ import annotations

from rungwise.contact.judge.certificate import Certificate, check
from rungwise.contact.step.problem import ContactProblem


def check_in_space(problem: ContactProblem, certificate: Certificate) -> bool:
    """Whether the certificate proves that a problem in space has no solution. A frictional one has modes and
    vectors of the scaled problem."""
    if certificate.kind != "frictional":
        return check(problem, certificate)
    # Few runs need what scaled problems need, and it takes long to import.
    from rungwise.contact.judge.farkas import Infeasible, proves
    from rungwise.contact.prepare.system import scaled
    from rungwise.contact.problem import Problem

    given = Problem.of(problem)
    return proves(given, scaled(given), Infeasible("jammed", certificate.modes, certificate.vectors))
