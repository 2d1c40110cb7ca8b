"""Plans executed in worlds that vary: guards, feedback, and how often they succeed."""
