"""Laws of contact beside Coulomb's friction and Newton's restitution, in steps of any system."""
