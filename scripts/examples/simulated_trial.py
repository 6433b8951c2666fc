"""A simulated trial for the examples, in place of your own: the landmarks of a raised arm, written as a .trc file."""

from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from models import load_model
from motions import Motions, read_motions

IN_THORAX_MM = {"IJ": (0, 0, 0), "C7": (0, 40, 120), "PX": (0, -170, -10), "T8": (0, -150, 130)}
GH_IN_SCAPULA_MM = (-10, -45, -15)
HUMERUS_MM, HALF_ELBOW_MM, RATE_HZ = 280.0, 35.0, 25.0


def shipped_subjects() -> Motions:
    """Read the ten simulated subjects that come with the package."""
    with as_file(files("motions") / "data" / "simulated_subjects.csv") as path:
        return read_motions(path)


def simulated_landmarks(model: str) -> dict[str, np.ndarray]:
    """Place the bones of a parameter set in the first shipped subject's abduction; return landmarks (frames, 3), mm."""
    subjects = shipped_subjects()
    mine = subjects.select((subjects.subject == "simulated01") & (subjects.motion == "abduction"))
    elevation_deg = np.linspace(0.0, 140.0, 71)
    angles_deg = np.stack([np.interp(elevation_deg, mine.humerus_elevation_deg, one) for one in mine.angles_deg.T])
    clavicle, scapula = (Rotation.from_euler("YZX", part.T, degrees=True) for part in (angles_deg[:3], angles_deg[3:]))
    humerus, girdle = Rotation.from_euler("Z", elevation_deg[:, None], degrees=True), load_model(model).girdle
    AC = np.asarray(girdle.sc_mm) + clavicle.apply(girdle.ac_mm)
    GH = AC + scapula.apply(GH_IN_SCAPULA_MM)
    elbow, half = GH - humerus.apply((0, HUMERUS_MM, 0)), humerus.apply((HALF_ELBOW_MM, 0, 0))
    moving = {"AC": AC, "TS": AC + scapula.apply(girdle.ts_mm), "AI": AC + scapula.apply(girdle.ai_mm), "GH": GH}
    fixed = {name: np.broadcast_to(place, AC.shape) for name, place in {**IN_THORAX_MM, "SC": girdle.sc_mm}.items()}
    return {**fixed, **moving, "EM": elbow - half, "EL": elbow + half}


def write_trc(path: Path, landmarks_mm: dict[str, np.ndarray] | None = None) -> Path:
    """Write landmarks (by default those of R2) as a motion capture system would."""
    landmarks_mm = landmarks_mm or simulated_landmarks("R2")
    xyz = np.concatenate(list(landmarks_mm.values()), axis=1)
    frames, count = len(xyz), len(landmarks_mm)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{RATE_HZ}\t{RATE_HZ}\t{frames}\t{count}\tmm\t{RATE_HZ}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(landmarks_mm) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{number}" for number in range(1, count + 1) for axis in "XYZ"),
        "",
        *("\t".join(map(str, (k + 1, k / RATE_HZ, *row))) for k, row in enumerate(xyz.tolist())),
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path
