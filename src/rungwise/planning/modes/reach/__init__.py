"""Goals that ask where a robot's own body is: reached through free space, then straight, as a peg into a
hole."""
