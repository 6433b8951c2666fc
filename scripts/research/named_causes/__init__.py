"""How often is the diagnosis right, and do its named causes predict measured shoulders?

Simulated data with a hidden truth: blind_check (worlds of synthetic_a), external_worlds (worlds of other authors, and
of synthetic_b), study_forms. Measured data with a known error: injected_faults. Measured data as they are:
measured_check (the gap on held-out motions and persons), measured_control (random causes), measured_fewer (fewer
shoulders), measured_noise.
"""
