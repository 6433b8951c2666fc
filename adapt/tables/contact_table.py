# pyright: reportArgumentType=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Forces on the scapula before and after adaptation: 'the change in force direction will be minimal' (thesis 6.4)."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from adapt.tables.before_after import STATES, BeforeAfter
from models.muscles.contact import FORCES, angle_deg, contact_forces
from models.person.family import AnyModel


def contact_table(pairs: Sequence[tuple[AnyModel, BeforeAfter]]) -> pd.DataFrame:
    """Tabulate ``contact.csv``: one row per model and posture that could be fitted before and after.

    ``TS_turned_deg``, ``AI_turned_deg``: angle between the normals of the ellipsoid at the landmark before and after;
    ``conoid_turned_deg``: angle between the directions of the ligament. ``TS_about_sc_before_mm`` ...: length of the
    force's arm about SC, on clavicle and scapula together, and about AC, on the scapula. Thorax frame; each state in
    its own fitted posture.
    """
    return pd.concat([_of_model(model.name, pair) for model, pair in pairs], ignore_index=True)


def _of_model(name: str, pair: BeforeAfter) -> pd.DataFrame:
    states = [contact_forces(state.girdle, state.angles) for state in (pair.before, pair.after)]
    turned = angle_deg(states[0].direction, states[1].direction)
    table = pair.rows.copy()
    table.insert(0, "model", name)
    for k, force in enumerate(FORCES):
        table[f"{force}_turned_deg"] = turned[k]
    for k, force in enumerate(FORCES):
        for joint in ("sc", "ac") if force != "conoid" else ("ac",):
            for word, state in zip(STATES, states, strict=True):
                arms = state.about_sc_mm if joint == "sc" else state.about_ac_mm
                table[f"{force}_about_{joint}_{word}_mm"] = np.linalg.norm(arms[:, k], axis=0)
    return table
