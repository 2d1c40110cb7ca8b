"""Plans lifted from stage to stage: replayed, repaired, or found anew."""
