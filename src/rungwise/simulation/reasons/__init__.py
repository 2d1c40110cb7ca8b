"""Why runs end, and what keeps them, in words and with proofs."""
