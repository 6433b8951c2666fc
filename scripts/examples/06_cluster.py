"""Adapt many subjects on a Dask cluster: here two workers in this process. Needs the extra `dask`.

On real machines start a scheduler and workers (`dask scheduler`, `dask worker ADDRESS --nthreads 1`), and pass the
scheduler's address. The subjects are simulated; results do not depend on where they are computed.
"""

import subprocess
import sys
from pathlib import Path

import pandas as pd
from distributed import LocalCluster
from simulated_trial import shipped_subjects

from motions import write_motions


def main(folder: Path) -> pd.DataFrame:
    """Adapt ten subjects in parts of five, and print the status of each."""
    folder.mkdir(parents=True, exist_ok=True)
    motions = folder / "motions.csv"
    write_motions(shipped_subjects(), motions)
    # Threads start quickly; for much work leave `processes` and `protocol` out: each worker is then a process.
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp://", dashboard_address=":0"
    ) as cluster:
        address = cluster.scheduler_address  # type: ignore[attr-defined]
        # As on the command line: girdle adapt motions.csv --model R2 --chunk 5 --dask tcp://host:8786 --out results
        command = ["adapt", motions, "--model", "R2", "--chunk", "5", "--dask", address, "--out", folder / "results"]
        subprocess.run([sys.executable, "-m", "adapt", *command], check=True)
    parameters = pd.read_csv(folder / "results" / "parameters.csv")
    print(parameters[["subject", "A_x_mm", "conoid_length_mm", "E", "status"]].round(2).to_string(index=False))
    return parameters


if __name__ == "__main__":
    main(Path("out/examples/cluster"))
