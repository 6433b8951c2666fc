"""Landmarks of a trial as the tables that capture software exports; a gap is an empty cell."""

import numpy as np

RATE = 100


def cells(lab: dict[str, np.ndarray], frame: int, gap: str = "") -> list[str]:
    """Return x, y, z of each marker in one frame."""
    return [gap if np.isnan(v) else repr(float(v)) for xyz in lab.values() for v in xyz[:, frame]]


def frames(lab: dict[str, np.ndarray]) -> range:
    """Return the numbers of the frames, from 0."""
    return range(next(iter(lab.values())).shape[1])


def vicon(lab: dict[str, np.ndarray], unit: str = "mm", subject: str = "P01:") -> list[list[str]]:
    """Make a table of Vicon Nexus: Trajectories, the rate, two rows of names, the units, the frames."""
    names = [cell for name in lab for cell in (subject + name, "", "")]
    rows = [["Trajectories"], [str(RATE)], ["", "", *names], ["Frame", "Sub Frame", *["X", "Y", "Z"] * len(lab)]]
    rows.append(["", "", *[unit] * 3 * len(lab)])
    return rows + [[str(k + 1), "0", *cells(lab, k)] for k in frames(lab)]


def motive(lab: dict[str, np.ndarray], unit: str = "Millimeters", subject: str = "P01:") -> list[list[str]]:
    """Make a table of OptiTrack Motive.

    It has keys and values, then types, names, numbers, kinds and axes above the frames; a rigid body comes first.
    """
    first = ["Format Version", "1.23", "Take Name", "abduction", "Export Frame Rate", f"{RATE}.000000"]
    body, axes = ["X", "Y", "Z", "W", "X", "Y", "Z", ""], ["X", "Y", "Z"] * len(lab)
    names = [cell for name in lab for cell in [subject + name] * 3]
    rows = [
        [*first, "Rotation Type", "Quaternion", "Length Units", unit, "Coordinate Space", "Global"],
        [],
        ["", "Type", *["Rigid Body"] * 8, *["Marker"] * 3 * len(lab)],
        ["", "Name", *["AMC"] * 8, *names],
        ["", "ID", *["1"] * 8, *[str(1000 + k // 3) for k in range(3 * len(lab))]],
        ["", "", *["Rotation"] * 4, *["Position"] * 3, "Mean Marker Error", *["Position"] * 3 * len(lab)],
        ["Frame", "Time (Seconds)", *body, *axes],
    ]
    return rows + [[str(k), f"{k / RATE:.6f}", *["0.1"] * 8, *cells(lab, k)] for k in frames(lab)]


def qualisys(
    lab: dict[str, np.ndarray], with_time: bool = True, gap: str = "", prefix: str = "P01_"
) -> list[list[str]]:
    """Make a table of Qualisys QTM: one word and its value per line, the names, then mm, after number and time of the
    frame where ``with_time``."""
    names = [prefix + name for name in lab]
    count = len(frames(lab))
    rows = [
        ["NO_OF_FRAMES", str(count)],
        ["NO_OF_CAMERAS", "8"],
        ["NO_OF_MARKERS", str(len(lab))],
        ["FREQUENCY", str(RATE)],
        ["DESCRIPTION", "--"],
        ["TIME_STAMP", "2024-05-03, 10:11:12.345", "63.20381838"],
        ["DATA_INCLUDED", "3D"],
        ["MARKER_NAMES", *names],
        ["TRAJECTORY_TYPES", *["Measured"] * len(lab)],
    ]
    if with_time:
        rows.append(["Frame", "Time", *(f"{name} {axis}" for name in names for axis in "XYZ")])
    lead = [[str(k + 1), f"{k / RATE:.5f}"] if with_time else [] for k in frames(lab)]
    return rows + [[*lead[k], *cells(lab, k, gap)] for k in frames(lab)]


def visual3d(lab: dict[str, np.ndarray], kind: str = "TARGET") -> list[list[str]]:
    """Make a table of Visual3D: file, name, type, folder and component above each column."""
    names = [name for name in lab for _ in "XYZ"]
    rows = [["", *[cell] * len(names)] for cell in ("P01.c3d", "", kind, "ORIGINAL")]
    rows[1][1:] = names
    return [*rows, ["ITEM", *["X", "Y", "Z"] * len(lab)], *([str(k + 1), *cells(lab, k)] for k in frames(lab))]


def landmarks(lab: dict[str, np.ndarray], column: str = "{name}_{axis}_mm") -> list[list[str]]:
    """Make a table with one header: one column per coordinate, named by the pattern ``column``."""
    header = [column.format(name=name, axis=axis, AXIS=axis.upper()) for name in lab for axis in "xyz"]
    return [header, *(cells(lab, k) for k in frames(lab))]


def text(rows: list[list[str]], separator: str = ",", decimal: str = ".") -> str:
    """Join the rows to text; with ``decimal`` as a comma, numbers are written with a comma."""

    def shown(cell: str) -> str:
        return cell.replace(".", decimal) if cell.replace(".", "").replace("-", "").replace("e", "").isdigit() else cell

    return "\n".join(separator.join(map(shown, row)) for row in rows) + "\n"
