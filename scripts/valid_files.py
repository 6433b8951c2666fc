"""Small valid files of every kind that a user provides, for ``scripts/fuzz_readers.py`` to break."""

import io
import re
import struct
from pathlib import Path

import ezc3d
import numpy as np

from adapt.output.run_files import inputs_record, write_run
from motions.formats.angle_table import table_from_motions
from motions.formats.mot import write_mot
from motions.landmarks.mapping import MARKERS
from motions.motion_csv.reading import read_motions
from motions.rhythm_subjects import DATA_FILE

_THORAX_MM = {"IJ": (0, 0, 0), "C7": (0, 40, 120), "PX": (0, -170, -10), "T8": (0, -150, 130)}
_SHOULDER_MM = {
    "SC": (20, -8, 12),
    "AC": (160, 20, 80),
    "TS": (60, 10, 130),
    "AI": (90, -100, 140),
    "AA": (155, 5, 110),
    "GH": (165, -25, 65),
    "EM": (200, -300, 80),
    "EL": (260, -290, 60),
}
_FRAMES = 4


def _positions_mm() -> dict[str, np.ndarray]:
    """Return landmark positions (frames, 3) of a slowly moving shoulder, by name."""
    rest = _THORAX_MM | _SHOULDER_MM
    moves = {name: name in _SHOULDER_MM for name in rest}
    return {name: np.array(rest[name]) + 3.0 * np.arange(_FRAMES)[:, None] * moves[name] for name in MARKERS}


def landmark_csv() -> bytes:
    positions = _positions_mm()
    header = ",".join(f"{name}_{axis}_mm" for name in positions for axis in "xyz")
    rows = (",".join(f"{x:g}" for place in positions.values() for x in place[k]) for k in range(_FRAMES))
    return "\n".join([header, *rows, ""]).encode()


def with_commas(content: bytes) -> bytes:
    """Write a table as spreadsheets do in many languages: with semicolons and decimal commas."""
    return re.sub(rb"(?<=;)(-?\d+)(?=;|\n)", rb"\1,5", content.replace(b",", b";"))


CLUSTER_MM = {"A1": (150.0, 30.0, 90.0), "A2": (170.0, 30.0, 80.0), "A3": (155.0, 45.0, 100.0)}
"""Markers on the acromion, which move with the shoulder."""


def _table(rows: list[list[str]], separator: str) -> bytes:
    return ("\n".join(separator.join(row) for row in rows) + "\n").encode()


def _frames() -> list[list[str]]:
    """Return x, y and z of all landmarks, one row per frame."""
    return [[f"{x:g}" for place in _positions_mm().values() for x in place[k]] for k in range(_FRAMES)]


def vicon() -> bytes:
    names = list(_positions_mm())
    rows = [["Trajectories"], ["100"], ["", "", *(cell for name in names for cell in (f"P1:{name}", "", ""))]]
    rows += [["Frame", "Sub Frame", *"XYZ" * len(names)], ["", "", *["mm"] * 3 * len(names)]]
    return _table([*rows, *([str(k + 1), "0", *cells] for k, cells in enumerate(_frames()))], ",")


def motive() -> bytes:
    names = [name for name in _positions_mm() for _ in range(3)]
    rows = [["Format Version", "1.23", "Export Frame Rate", "100.0", "Length Units", "Millimeters"], []]
    rows += [["", "Type", *["Marker"] * len(names)], ["", "Name", *names], ["", "", *["Position"] * len(names)]]
    rows.append(["Frame", "Time (Seconds)", *"XYZ" * (len(names) // 3)])
    return _table([*rows, *([str(k), f"{k / 100}", *cells] for k, cells in enumerate(_frames()))], ",")


def qualisys() -> bytes:
    names = list(_positions_mm())
    rows = [["NO_OF_FRAMES", str(_FRAMES)], ["NO_OF_MARKERS", str(len(names))], ["FREQUENCY", "100"]]
    return _table([*rows, ["DATA_INCLUDED", "3D"], ["MARKER_NAMES", *names], *_frames()], "\t")


def visual3d() -> bytes:
    names = [name for name in _positions_mm() for _ in range(3)]
    rows = [["", *[cell] * len(names)] for cell in ("P1.c3d", "", "TARGET", "ORIGINAL")]
    rows[1][1:] = names
    rows.append(["ITEM", *"XYZ" * (len(names) // 3)])
    return _table([*rows, *([str(k), *cells] for k, cells in enumerate(_frames(), 1))], "\t")


def matlab() -> bytes:
    """Write a table whose variables are matrices, as MATLAB's writetable does."""
    return _table([[f"{name}_{k}" for name in _positions_mm() for k in (1, 2, 3)], *_frames()], ",")


def of_pandas() -> bytes:
    """Write a pandas table with two header rows, after a ``sep=;`` line, which names the delimiter to spreadsheets."""
    names = list(_positions_mm())
    rows = [["sep=;"], ["", *(name for name in names for _ in range(3))], ["", *"xyz" * len(names)]]
    return _table([*rows, *([str(k), *cells] for k, cells in enumerate(_frames()))], ";")


def trc(more_mm: dict[str, tuple[float, float, float]] | None = None) -> bytes:
    moved = {name: np.array(place) + 3.0 * np.arange(_FRAMES)[:, None] for name, place in (more_mm or {}).items()}
    positions = _positions_mm() | moved
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ttrial.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"100\t100\t{_FRAMES}\t{len(positions)}\tmm\t100\t1\t{_FRAMES}",
        "Frame#\tTime\t" + "\t\t\t".join(positions) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{k + 1}" for k in range(len(positions)) for axis in "XYZ"),
        "",
    ]
    for k in range(_FRAMES):
        cells = (f"{x:g}" for place in positions.values() for x in place[k])
        lines.append(f"{k + 1}\t{k / 100}\t" + "\t".join(cells))
    return "\n".join([*lines, ""]).encode()


def mot(folder: Path) -> bytes:
    motions = read_motions(DATA_FILE)
    path = folder / "valid.mot"
    write_mot(table_from_motions(motions.select(np.arange(len(motions.posture)) < 7), False, str(path)), path)
    return path.read_bytes()


def c3d(folder: Path) -> bytes:
    positions = _positions_mm()
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(positions)
    points = np.ones((4, len(positions), _FRAMES))
    points[:3] = np.stack([place.T for place in positions.values()], axis=1)
    content["data"]["points"] = points
    path = folder / "valid.c3d"
    content.write(str(path))
    return path.read_bytes()


def run_json(folder: Path) -> bytes:
    write_run(folder, "adapt", inputs_record([DATA_FILE], ["R2"]), {"weight": 10.0, "objective": "mm2_deg2"})
    return (folder / "run.json").read_bytes()


def motion_csv() -> bytes:
    """Return the motion CSV of two of the shipped subjects."""
    return b"\n".join(DATA_FILE.read_bytes().splitlines()[:29])


MAPPING = b"""unit = "mm"
axes = ["x", "y", "z"]
scapula_relative_to = "thorax"
[markers]
IJ = "STRN"
[clusters]
scapula = ["A1", "A2", "A3"]
"""

CLICKS = b"""slice,x_px,y_px,use,surface,subject
a.png,10,12.5,draw,thorax,P1
a.png,30,12,,thorax,P1
1,30,28,draw,thorax,P1
b,9,8,correct,thorax,P1
b,19,8,correct,thorax,P1
b,14,3,correct,thorax,P1
"""

CIRCLED = b"""slice,x_px,y_px,surface
a.png,30,20,teres major
a.png,25,28.7,teres major
a.png,15,28.7,teres major
a.png,10,20,teres major
a.png,15,11.3,teres major
a.png,25,11.3,teres major
"""
"""Clicks along the edge of the disc of ``disc``."""


def disc() -> np.ndarray:
    """Return an image with a bright disc of radius 10 pixels about (20, 20)."""
    y, x = np.mgrid[:40, :50]
    return np.where((x - 20) ** 2 + (y - 20) ** 2 <= 100, 200, 20).astype(np.uint8)


def png() -> bytes:
    """Write the disc as an image."""
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(disc()).save(content, "png")
    return content.getvalue()


def dicom() -> bytes:
    """Write the disc as a slice of a scan (DICOM)."""
    from pydicom.dataset import Dataset, FileMetaDataset
    from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian

    slice_ = Dataset()
    slice_.SOPClassUID, slice_.SOPInstanceUID, slice_.Modality = CTImageStorage, "1.2.3", "CT"
    slice_.Rows, slice_.Columns = disc().shape
    slice_.SamplesPerPixel, slice_.PhotometricInterpretation, slice_.PixelRepresentation = 1, "MONOCHROME2", 0
    slice_.BitsAllocated, slice_.BitsStored, slice_.HighBit = 8, 8, 7
    slice_.PixelSpacing, slice_.ImagePositionPatient = [1, 1], [0, 0, 0]
    slice_.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    slice_.PixelData = disc().tobytes()
    slice_.file_meta = FileMetaDataset()
    slice_.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    content = io.BytesIO()
    slice_.save_as(content, enforce_file_format=True)
    return content.getvalue()


_CORNERS = [(60.0 * x, 40.0 * y, 90.0 * z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
_FACES = [
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
]


def stl() -> bytes:
    """Write a box as binary STL."""
    facets = (struct.pack("<12fH", 0, 0, 0, *(x for k in face for x in _CORNERS[k]), 0) for face in _FACES)
    return bytes(80) + struct.pack("<I", len(_FACES)) + b"".join(facets)


def stl_text() -> bytes:
    """Write the box as STL in text."""
    lines = ["solid bone"]
    for face in _FACES:
        corners = (f"vertex {x:g} {y:g} {z:g}" for x, y, z in (_CORNERS[k] for k in face))
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid bone", ""]).encode()


def _ply_head(form: str) -> str:
    sizes = [f"element vertex {len(_CORNERS)}", *(f"property float {axis}" for axis in "xyz")]
    faces = [f"element face {len(_FACES)}", "property list uchar int vertex_indices"]
    return "\n".join(["ply", f"format {form} 1.0", *sizes, *faces, "end_header", ""])


def ply() -> bytes:
    """Write the box as PLY in text."""
    rows = [f"{x:g} {y:g} {z:g}" for x, y, z in _CORNERS] + [f"3 {a} {b} {c}" for a, b, c in _FACES]
    return (_ply_head("ascii") + "\n".join([*rows, ""])).encode()


def ply_binary() -> bytes:
    """Write the box as binary PLY."""
    corners, faces = (struct.pack("<3f", *one) for one in _CORNERS), (struct.pack("<B3i", 3, *one) for one in _FACES)
    return _ply_head("binary_little_endian").encode() + b"".join([*corners, *faces])


def vtp() -> bytes:
    """Write the box as VTP, the format of OpenSim's geometry."""

    def array(kind: str, name: str, values: np.ndarray, components: int = 1) -> str:
        text = " ".join(f"{x:g}" for x in values.ravel())
        head = f'type="{kind}" Name="{name}" NumberOfComponents="{components}" format="ascii"'
        return f"<DataArray {head}>{text}</DataArray>"

    corners, faces = np.array(_CORNERS), np.array(_FACES)
    polys = array("Int64", "connectivity", faces) + array("Int64", "offsets", 3 * np.arange(1, len(faces) + 1))
    return (
        '<?xml version="1.0"?><VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"><PolyData>'
        f'<Piece NumberOfPoints="{len(corners)}" NumberOfPolys="{len(faces)}" NumberOfVerts="0" NumberOfLines="0" '
        f'NumberOfStrips="0"><Points>{array("Float64", "Points", corners, 3)}</Points><Polys>{polys}</Polys>'
        "</Piece></PolyData></VTKFile>"
    ).encode()


def points_csv() -> bytes:
    """Return a table of landmarks, one per row."""
    rows = (f"{name},{x:g},{y:g},{z:g}" for name, place in _positions_mm().items() for x, y, z in place[:1])
    return "\n".join(["landmark,x_mm,y_mm,z_mm", *rows, ""]).encode()


ATTACHMENTS = b"""attachment,shape,x_mm,y_mm,z_mm
conoid,point,10,20,30
trapezius,line,0,0,0
trapezius,line,10,2,0
deltoid,plane,5,5,5
deltoid,plane,15,5,5
deltoid,plane,15,9,5
"""

SURFACE_POINTS = b"""surface,x_mm,y_mm,z_mm,subject,posture
thorax,100,-60,70,,1
thorax,110,-90,80,,1
thorax,105,-120,90,,2
thorax,90,-150,95,,
humeral_head,170,-20,60,,
humeral_head,160,-30,55,,
"""
"""Points on bones, in the frame of the landmarks."""

COORDINATES = b"""subject,motion,posture,humerus_elevation_deg,AC_y_mm,AC_z_mm,TS_x_mm
P1,abduction,1,10,15,80,60
P1,abduction,2,60,30,90,50
"""

DIAGNOSIS = b'{"verdict": {"answer": "effect"}, "options": ["thorax_asymmetry=5", "ac_offset=2,3,1,0,0"]}'

FITS = (
    b"model,subject,motion,posture,humerus_elevation_deg,adapted,clavicle_y_simulated_deg,clavicle_z_simulated_deg,"
    b"clavicle_x_simulated_deg,scapula_y_simulated_deg,scapula_z_simulated_deg,scapula_x_simulated_deg,status\n"
    b"R2,P1,abduction,1,10,0,-28,12,7,32,11,-10,ok\nR2,P1,abduction,2,60,1,-31,14,9,33,25,-8,ok\n"
)

LIST = f"{'0' * 64}  fits.csv\n{'1' * 64}  models/R2_P1.toml\n".encode()
"""List of files and checksums, as in ``girdle.sha256``."""

STUDIES = (
    b"dataset_id,dataset_authors,dataset_year,thorax_y_direction,scapula_z_direction,side_as_right\n"
    b"#1,Ludewig et al.,2009,vec((T8+PX)/2>(C7+IJ)/2),vec(TS>AC),True\n"
)
_FILES = (
    ("sternoclavicular", ("SC_protraction", "SC_elevation", "SC_rotation")),
    ("scapulothoracic", ("ST_protraction", "ST_medRotation", "ST_tilt")),
)
JOINTS = (
    "dataset_id,dataset_authors,humeral_motion,joint,euler_sequence,shoulder_id,side,folder,"
    "dof_1st_euler,dof_2nd_euler,dof_3rd_euler\n"
    + "".join(
        f"#1,Ludewig et al.,frontal plane elevation,{joint},yx'z'',,right,#1_Ludewig_et_al,"
        f"{','.join(f'{name}.csv' for name in names)}\n"
        for joint, names in _FILES
    )
).encode()
CURVES = {
    name: b"20,%d\n40,%d\n60,%d\n80,%d\n" % tuple(first + k * step for k in range(4))
    for name, first, step in (
        *(("SC_protraction", -23, -3), ("SC_elevation", -10, -2), ("SC_rotation", 4, 4)),
        *(("ST_protraction", 39, -1), ("ST_medRotation", -12, -7), ("ST_tilt", -8, 2)),
    )
}


def spartacus(folder: Path) -> None:
    """Write a checkout of the Spartacus collection with one study."""
    tables, data = folder / "spartacus" / "dataset", folder / "spartacus" / "data" / "#1_Ludewig_et_al"
    for one in (tables, data):
        one.mkdir(parents=True, exist_ok=True)
    (tables / "dataset_of_datasets.csv").write_bytes(STUDIES)
    (tables / "dataset_clean_of_joint_data.csv").write_bytes(JOINTS)
    for name, curve in CURVES.items():
        (data / f"{name}.csv").write_bytes(curve)
