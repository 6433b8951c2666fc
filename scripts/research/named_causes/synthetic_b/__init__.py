"""A second simulated world to test the diagnosis on, by another author than the first (``synthetic_a``).

Its author did not see the effect library, the fits or the first world. Only the parameter sets (plain data), the
conventions and the one-line descriptions of the effects are shared, so that this world does not rest on the same
assumptions as the rest of the project. Each world is a folder with motions.csv (the laboratory's data) and truth.json.

    python -m scripts.research.named_causes.synthetic_b out/worlds --condition ten
    python scripts/research/named_causes/external_worlds.py out/worlds --out out/external
"""
