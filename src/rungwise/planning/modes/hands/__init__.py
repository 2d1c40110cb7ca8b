"""Plans of a hand: fingers hold an object, turn it as far as their joints go, let go, and hold it anew."""
