"""Program that reads a surface by vtk for the module ``mesh``, in a process of its own because vtk can crash.

Arguments: path, and time limit in seconds after which the program ends itself. It writes a numpy archive to stdout,
with corners (corners, 3) and triangles (triangles, 3).
"""

import faulthandler
import sys
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand, vtkObject
from vtkmodules.vtkFiltersCore import vtkCleanPolyData, vtkTriangleFilter
from vtkmodules.vtkIOGeometry import vtkSTLReader
from vtkmodules.vtkIOPLY import vtkPLYReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

_READERS = {".stl": vtkSTLReader, ".ply": vtkPLYReader, ".vtp": vtkXMLPolyDataReader}


def _main(path: str) -> None:
    reader, split, clean = _READERS[Path(path).suffix.lower()](), vtkTriangleFilter(), vtkCleanPolyData()
    said: list[str] = []
    for one in (reader, split, clean):
        one.AddObserver(vtkCommand.ErrorEvent, lambda *_: said.append("the reader stopped in it"))
    reader.SetFileName(path)
    split.SetInputConnection(reader.GetOutputPort())
    split.PassLinesOff()
    split.PassVertsOff()
    clean.SetInputConnection(split.GetOutputPort())
    vtkObject.GlobalWarningDisplayOff()  # vtk's warnings are for programmers
    clean.Update()
    if said:
        sys.exit(said[0])
    surface = clean.GetOutput()
    corners, triangles = np.zeros((0, 3)), np.zeros((0, 3), int)
    if surface.GetNumberOfPoints():
        corners = np.array(vtk_to_numpy(surface.GetPoints().GetData()), float)
        triangles = np.array(vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3), int)
    np.savez(sys.stdout.buffer, corners=corners, triangles=triangles)


if __name__ == "__main__":
    faulthandler.dump_traceback_later(float(sys.argv[2]), exit=True)
    _main(sys.argv[1])
