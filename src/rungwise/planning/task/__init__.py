"""A scene's task at one instance: what is drawn, what bounds it, and goals made narrower."""
