"""What touches what in a scene in space, and places on the surfaces of its bodies."""
