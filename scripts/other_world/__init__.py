"""A second simulated world to test the diagnosis on, by another author than the first (``scripts/blind_world``).

Written without sight of effect library, fits or the first world: only the parameter sets (plain data), the conventions
and the one-line descriptions of the effects are shared, so that what the others of this project take for granted is not
taken for granted here. Each world is a folder with motions.csv (what the laboratory saw) and truth.json.

    python -m scripts.other_world out/worlds --condition ten
    python scripts/check_elsewhere.py out/worlds --out out/elsewhere
"""
