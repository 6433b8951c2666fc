"""What of Kaptein's thesis comes out again on measured motions, and how are its cadavers completed?

compare_thesis (Tables 3.4, 3.5, 6.1-6.6), study_objective (which reading of E), study_completion (what is not printed),
study_chapter7 (its questions for later work). printed.toml holds the tables as printed; outcomes, variants and scores
put adaptations beside them. distance_matrices and attachment_types: Tables 4.1, 5.1 and 5.3.
"""
