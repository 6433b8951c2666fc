"""Program that reads a .c3d file with ezc3d for ``c3d``, in a process of its own because ezc3d can crash.

It writes a numpy archive to stdout: points (4, markers, frames), labels, the number of frames that the file says, unit
and rate ("" and 0 if not said). It ends by itself after the given seconds, because ezc3d may never end and the waiting
parent process may be killed.
"""

import faulthandler
import sys

import ezc3d
import numpy as np


def _labels(point) -> list[str]:
    """Return the names in LABELS, LABELS2, ...: one parameter holds 255 names."""
    parts = [key for key in point if key.startswith("LABELS")]
    return [name.strip() for key in sorted(parts, key=len) for name in point[key]["value"]]


def _main(path: str) -> None:
    content = ezc3d.c3d(path)
    point = content["parameters"]["POINT"]
    unit = point["UNITS"]["value"][0] if "UNITS" in point and point["UNITS"]["value"] else ""
    frames = int(point["FRAMES"]["value"][0]) if "FRAMES" in point else 0
    rate = float(point["RATE"]["value"][0]) if "RATE" in point and len(point["RATE"]["value"]) else 0.0
    points = np.asarray(content["data"]["points"], dtype=float)
    labels = np.array(_labels(point), dtype=str)
    np.savez(sys.stdout.buffer, points=points, labels=labels, unit=unit, rate=rate, frames=frames)


if __name__ == "__main__":
    faulthandler.dump_traceback_later(float(sys.argv[2]), exit=True)
    try:
        _main(sys.argv[1])
    except Exception as error:
        sys.exit(str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__)
