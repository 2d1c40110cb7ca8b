"""What an answer is worth, and proofs that there is none. Knows no solver."""

from rungwise.contact.judge.certificate import Certificate, check
from rungwise.contact.judge.infeasible import certify_infeasible, certify_unsupported

__all__ = [
    "Certificate", "certify_infeasible", "certify_unsupported", "check",
]  # fmt: skip
