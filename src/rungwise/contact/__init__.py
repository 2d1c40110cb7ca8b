"""Contact problems: what they are, how they are solved, how a solution or its absence is judged."""
