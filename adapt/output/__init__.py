"""Files of a run: written together or not at all, with a record that is enough to repeat it."""
