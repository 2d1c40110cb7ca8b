"""What an answer is worth, and proofs that there is none. Knows no solver."""
