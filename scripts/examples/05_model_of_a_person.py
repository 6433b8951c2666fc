"""A person's own model: a parameter set from the landmarks of a trial, adapted beside a cadaver's set.

The person is simulated, with the bones of the set R4; the base set, which supplies the unmeasured numbers, is R2.
"""

import subprocess
import sys
from pathlib import Path

from simulated_trial import simulated_landmarks, write_trc

from adapt import adapt_subjects
from models import ParameterSet, load_model
from motions import read_trial


def main(folder: Path) -> ParameterSet:
    """Make the set, print its lengths beside those of R2, and the gaps with both sets."""
    trial, own = write_trc(folder / "P01.trc", simulated_landmarks("R4")), folder / "P01.toml"
    # As on the command line: girdle model P01.trc --model R2 --out P01.toml
    subprocess.run([sys.executable, "-m", "adapt", "model", trial, "--model", "R2", "--out", own], check=True)

    sets = [load_model(str(own)), load_model("R2")]
    for one in sets:
        print(f"{one.name}: clavicle {one.girdle.ac_mm[0]:.1f} mm ({one.source['clavicle.length_mm']})")

    motions = read_trial(trial, motion="abduction", at_deg=range(10, 131, 20))
    summary = adapt_subjects(motions, sets).summary.query("subject == 'P01' and motion == 'all'")
    print(summary[["model", "adapted", "clavicle_deg", "scapula_deg"]].round(2).to_string(index=False))
    return sets[0]


if __name__ == "__main__":
    main(Path("out/examples/model_of_a_person"))
