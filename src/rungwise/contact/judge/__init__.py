"""What an answer is worth, and proofs that there is none. Knows no solver."""

from rungwise.contact.judge.certificate import Certificate
from rungwise.contact.judge.find_certificates import (
    Balance,
    certify_infeasible,
    certify_or_balance,
    certify_unsupported,
)
from rungwise.contact.judge.in_space import check_in_space

__all__ = [
    "Balance", "Certificate", "certify_infeasible", "certify_or_balance", "certify_unsupported",
    "check_in_space",
]  # fmt: skip
