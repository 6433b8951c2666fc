"""What of Kaptein's thesis comes out again on measured motions, and how are its cadavers completed?

study_objective (which reading of E), study_completion (what is not printed), study_unpublished (which of that decides).
outcomes, variants and scores put adaptations beside the printed tables (adapt.trust.thesis). `girdle compare` and
`girdle questions` are commands.
"""
