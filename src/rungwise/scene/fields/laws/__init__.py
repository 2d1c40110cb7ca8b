"""Laws of contact, one file each: the fields that name it in a scene, what it does, and its words."""
