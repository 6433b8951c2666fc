"""How often is the diagnosis right, and do the causes that it names predict measured shoulders?

Simulated, the truth hidden: blind_check (worlds of synthetic_a), external_worlds (of others, and of synthetic_b),
study_forms. Measured with a known error: injected_faults. Measured as they are: measured_check (the gap on unseen
motions and persons), measured_control (causes at random), measured_fewer (fewer shoulders), measured_noise.
"""
