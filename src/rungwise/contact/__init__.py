"""Contact problems: their form, their solvers, and the judgement of a solution or of its absence."""
