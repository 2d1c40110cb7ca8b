"""Runs that are told their inputs step by step: what is seen of them, and what they are told."""
