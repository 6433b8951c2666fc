"""Write the sample trials of `motions/data`, all simulated: landmarks as .trc and .c3d, a cluster and a static trial.

    python scripts/examples/write_samples.py        # writes the same numbers each time

Each trial is the abduction of the first shipped subject on the bones of R2 (`simulated_trial.py`). In the cluster trial
the markers on the acromion, the upper arm and the sternum are rigid with their bones: skin does not move.
"""

import sys
from pathlib import Path

import ezc3d
import numpy as np
from scipy.spatial.transform import Rotation
from simulated_trial import RATE_HZ, simulated_landmarks, write_trc

DIGITS, STATIC_FRAMES = 2, 10
"""Decimals of positions in mm, and frames of the static trial."""

CLUSTERS = {
    "scapula": ("AC", "TS", "AI", {"AMC1": (-20, 15, 25), "AMC2": (-45, 25, 10), "AMC3": (-35, 5, 45)}),
    "humerus": ("GH", "EM", "EL", {"ARM1": (10, -120, 45), "ARM2": (40, -150, 30), "ARM3": (15, -180, 45)}),
    "thorax": ("IJ", "PX", "C7", {"STE1": (0, -40, -15), "STE2": (25, -60, -15), "STE3": (-25, -60, -15)}),
}
"""Origin and two more landmarks of each segment, and its markers, in mm from the origin at the first frame."""

MAPPING = """\
unit = "mm"

[clusters]
scapula = ["AMC1", "AMC2", "AMC3"]
humerus = ["ARM1", "ARM2", "ARM3"]
thorax = ["STE1", "STE2", "STE3"]
"""


def cluster_markers(landmarks_mm: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Move the markers of each cluster rigidly with its segment; return positions ``(frames, 3)``, mm."""
    found = {}
    for origin, *others, markers in CLUSTERS.values():
        arms = np.stack([landmarks_mm[name] - landmarks_mm[origin] for name in others], axis=1)
        turns = [Rotation.align_vectors(arm, arms[0])[0] for arm in arms]
        for name, place in markers.items():
            found[name] = landmarks_mm[origin] + np.stack([turn.apply(place) for turn in turns])
    return found


def write_c3d(path: Path, markers_mm: dict[str, np.ndarray]) -> None:
    """Write markers as a .c3d file."""
    content = ezc3d.c3d()
    point = content["parameters"]["POINT"]
    point["RATE"]["value"], point["LABELS"]["value"], point["UNITS"]["value"] = [RATE_HZ], list(markers_mm), ["mm"]
    xyz = np.stack([one.T for one in markers_mm.values()], axis=1)
    content["data"]["points"] = np.concatenate([xyz, np.ones((1, *xyz.shape[1:]))])
    content.write(str(path))


def main(folder: Path) -> None:
    """Write the five files into a folder."""
    landmarks = {name: np.round(one, DIGITS) for name, one in simulated_landmarks("R2").items()}
    markers = {name: np.round(one, DIGITS) for name, one in cluster_markers(landmarks).items()}
    write_trc(folder / "simulated_trial.trc", landmarks)
    write_c3d(folder / "simulated_trial.c3d", landmarks)
    still = {name: np.repeat(one[:1], STATIC_FRAMES, axis=0) for name, one in {**landmarks, **markers}.items()}
    write_trc(folder / "simulated_cluster_static.trc", still)
    write_trc(folder / "simulated_cluster_trial.trc", markers)
    (folder / "simulated_cluster.toml").write_text(MAPPING, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "motions" / "data")
