"""The parameter set of a person, made from landmarks, points and a generic set (thesis, Chapters 4 and 5)."""
