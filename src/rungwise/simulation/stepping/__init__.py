"""Steps of any system, one after another: attempts, lengths, conditions, and what failures mean."""
