"""A second simulated world to test the diagnosis on, by another author than the first (``synthetic_a``).

Written without sight of effect library, fits or the first world: only the parameter sets (plain data), the conventions
and the one-line descriptions of the effects are shared, so that what the others of this project take for granted is not
taken for granted here. Each world is a folder with motions.csv (what the laboratory saw) and truth.json.

    python -m scripts.research.named_causes.synthetic_b out/worlds --condition ten
    python scripts/research/named_causes/external_worlds.py out/worlds --out out/external
"""
