"""A parameter set of a person: from landmarks, points and a generic set (thesis, Chapters 4 and 5)."""
