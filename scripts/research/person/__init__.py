"""Does a person's own parameter set fit better than a cadaver's, and which set should give what was not measured?

study_person and study_base_set, of simulated_persons.
"""
