"""The worth of an answer, and proofs that there is none. This package knows no solver."""
