"""Plans: found on one model of contact, lifted to richer ones, diagnosed, verified."""
