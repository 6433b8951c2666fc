"""Which results of Kaptein's thesis are reproduced on measured motions, and how are its cadavers completed?

study_objective (which reading of E), study_completion (unpublished numbers), study_unpublished (which of these matter
most). outcomes, variants and scores compare adaptations with the printed tables (adapt.trust.thesis). `girdle compare`
and `girdle questions` are commands.
"""
