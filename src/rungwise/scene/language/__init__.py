"""The language of a scene's expressions: names, programs, conditions."""
