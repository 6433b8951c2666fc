"""Ten subjects and three parameter sets: gaps before and after adaptation, and the change of the parameters.

The subjects are the simulated ones that come with the package. On the command line: `girdle adapt
simulated_subjects.csv --model R2 --model R4 --model R6 --out results`.
"""

import pandas as pd
from simulated_trial import shipped_subjects

from adapt import adapt_subjects
from models import load_model


def main() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Print the mean gaps per set, and the parameters of the first subject."""
    motions = shipped_subjects()  # or read_motions("mysubjects.csv", ...)
    result = adapt_subjects(motions, [load_model(name) for name in ("R2", "R4", "R6")])

    means = result.summary.query("subject == 'mean' and motion == 'all'")
    gaps_deg = means.pivot(index="model", columns="adapted", values=["clavicle_deg", "scapula_deg"])
    print(gaps_deg.rename(columns={0: "before", 1: "after"}).round(2))

    changed = result.parameters.query("subject == 'simulated01'").set_index("model")
    print(changed[["A_x_mm_model", "A_x_mm", "A_x_mm_sd", "A_x_mm_at_bound", "E"]].round(2))
    return gaps_deg, result.parameters


if __name__ == "__main__":
    main()
