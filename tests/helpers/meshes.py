"""Triangle meshes as files, written without the library that reads them."""

import struct
from pathlib import Path

import numpy as np

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]).T
FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5)),
        *((0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)),
        *((0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)


def write_stl(path: Path, corners: np.ndarray, faces: np.ndarray, binary: bool = True) -> Path:
    if binary:
        facets = (struct.pack("<12fH", 0, 0, 0, *corners.T[face].ravel(), 0) for face in faces)
        path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + b"".join(facets))
        return path
    lines = ["solid bone"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in corners.T[face].tolist()]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid bone", ""]))
    return path


def write_ply(path: Path, corners: np.ndarray, faces: np.ndarray) -> Path:
    head = ["ply", "format ascii 1.0", f"element vertex {corners.shape[1]}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    body = [f"{x} {y} {z}" for x, y, z in corners.T.tolist()]
    path.write_text("\n".join([*head, *body, *(f"3 {a} {b} {c}" for a, b, c in faces.tolist()), ""]))
    return path


def write_vtp(path: Path, corners: np.ndarray, faces: np.ndarray) -> Path:
    """Write a mesh as OpenSim does: XML with the numbers as text."""

    def array(kind: str, name: str, numbers: np.ndarray, components: int = 1) -> str:
        text = " ".join(map(str, numbers.ravel().tolist()))
        head = f'type="{kind}" Name="{name}" NumberOfComponents="{components}" format="ascii"'
        return f"<DataArray {head}>{text}</DataArray>"

    places = array("Float64", "Points", corners.T, 3)
    polys = array("Int64", "connectivity", faces) + array("Int64", "offsets", 3 * np.arange(1, len(faces) + 1))
    path.write_text(
        '<?xml version="1.0"?><VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"><PolyData>'
        f'<Piece NumberOfPoints="{corners.shape[1]}" NumberOfPolys="{len(faces)}" NumberOfVerts="0" NumberOfLines="0" '
        f'NumberOfStrips="0"><Points>{places}</Points><Polys>{polys}</Polys></Piece></PolyData></VTKFile>'
    )
    return path


WRITERS = {".stl": write_stl, ".ply": write_ply, ".vtp": write_vtp}
