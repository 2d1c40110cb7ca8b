"""Plans by contact modes: what objects do at their contacts is chosen, fingers are placed to make them do it,
and what they are to do is laid out as inputs and run."""
