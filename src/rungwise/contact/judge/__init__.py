"""What an answer is worth, and whether a proof is one. Knows no solver."""

from rungwise.contact.judge.certificate import Balance, Certificate

__all__ = ["Balance", "Certificate"]
