"""Does a person's own parameter set fit better than a cadaver's, and which set should supply the unmeasured numbers?

study_person and study_base_set use simulated_persons. study_own_bones, study_both_sides and study_misfit are
about own bones.
"""
