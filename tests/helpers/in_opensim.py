"""OpenSim in a process of its own: the libraries of its package conflict with others, such as CasADi.

``python in_opensim.py model MODEL.osim TURNED_DEG`` and ``python in_opensim.py table MOTION.mot`` print JSON.
"""

import json
import sys
from typing import Any

import opensim as osim

LENGTHS = ("SC", "AC", "TS", "AI")
CLAVICLE = ("clavicle_y", "clavicle_z", "clavicle_x")


def opened(path: str, turned_deg: float) -> dict[str, Any]:
    """Assemble the model with the clavicle protracted by a further ``turned_deg``.

    Return the angles of the clavicle (rad), and the markers and ends of the conoid (m, in ground).
    """
    model = osim.Model(path)
    state = model.initSystem()
    coordinates = model.getCoordinateSet()
    protraction = coordinates.get(CLAVICLE[0])
    protraction.setValue(state, protraction.getValue(state) + turned_deg * osim.SimTK_DEGREE_TO_RADIAN, False)
    protraction.setLocked(state, True)
    model.assemble(state)
    model.realizePosition(state)
    conoid = osim.ConstantDistanceConstraint.safeDownCast(model.getConstraintSet().get("conoid"))
    ends = [
        model.getBodySet().get(body).findStationLocationInGround(state, place)
        for body, place in (
            ("clavicle", conoid.get_location_body_1()),
            ("scapula", conoid.get_location_body_2()),
        )
    ]
    return {
        "clavicle_rad": [coordinates.get(name).getValue(state) for name in CLAVICLE],
        "markers_m": {name: _list(model.getMarkerSet().get(name).getLocationInGround(state)) for name in LENGTHS},
        "conoid_m": [_list(end) for end in ends],
    }


def read(path: str) -> dict[str, Any]:
    """Read a motion table: its columns, and whether it is in degrees."""
    table = osim.TimeSeriesTable(path)
    columns = {name: table.getDependentColumn(name).to_numpy().tolist() for name in table.getColumnLabels()}
    return {"in_degrees": table.getTableMetaDataAsString("inDegrees"), "columns": columns}


def _list(place: Any) -> list[float]:
    return [place.get(axis) for axis in range(3)]


if __name__ == "__main__":
    osim.Logger.removeFileSink()
    osim.Logger.setLevelString("error")
    kind, path, *more = sys.argv[1:]
    print(json.dumps(opened(path, float(more[0])) if kind == "model" else read(path)))
