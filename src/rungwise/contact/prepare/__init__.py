"""Preparation of a problem for solvers: elimination, scaling, rank, division into islands."""
