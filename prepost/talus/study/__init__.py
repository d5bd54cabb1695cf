"""Studies: many runs of one base folder of decks, with parameters drawn by a plan."""
