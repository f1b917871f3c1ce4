"""Small files of other programs about the pictures a.png and b.png, 800 × 600 px."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.sources import read_camera_file

NAMES, SIZES = ("a.png", "b.png"), ((800, 600), (800, 600))
# Of each of COLMAP's models its number and parameters, f = 700 px or 700 and 710.
COLMAP_MODELS = {
    "SIMPLE_PINHOLE": (0, (700, 401, 299)), "PINHOLE": (1, (700, 710, 401, 299)),
    "SIMPLE_RADIAL": (2, (700, 401, 299, -0.1)), "RADIAL": (3, (700, 401, 299, -0.1, 0.02)),
    "OPENCV": (4, (700, 710, 401, 299, -0.1, 0.02, 0.001, -0.002)),
    "FULL_OPENCV": (6, (700, 710, 401, 299, -0.1, 0.02, 0.001, -0.002, 0.003, 0, 0, 0)),
    "OPENCV_FISHEYE": (5, (700, 710, 401, 299, 0.01, -0.002, 0.0003, -0.0001)),
}  # fmt: skip
# Turned by 90° to the right about the vertical, w x y z, and a place.
TURN, MOVE = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0), (0.5, -0.25, 2.0)


def colmap_text(folder: Path, model: str) -> Path:
    """A model in text; the pictures lie in a folder of their own, the first has no points."""
    parameters = " ".join(map(repr, COLMAP_MODELS[model][1]))
    (folder / "cameras.txt").write_text(f"# a comment\n3 {model} 800 600 {parameters}\n")
    (folder / "images.txt").write_text(
        "# a comment\n1 1 0 0 0 0 0 0 3 images/a.png\n\n"
        f"2 {' '.join(map(repr, (*TURN, *MOVE)))} 3 images/b.png\n1.5 2.5 -1 3 4 7\n"
    )
    return folder


def colmap_binary(folder: Path, model: str) -> Path:
    """The same in binary."""
    number, parameters = COLMAP_MODELS[model]
    camera = struct.pack("<iiQQ", 3, number, 800, 600) + struct.pack(f"<{len(parameters)}d", *parameters)
    (folder / "cameras.bin").write_bytes(struct.pack("<Q", 1) + camera)
    first = struct.pack("<i7di", 1, 1, 0, 0, 0, 0, 0, 0, 3) + b"images/a.png\0" + struct.pack("<Q", 0)
    second = struct.pack("<i7di", 2, *TURN, *MOVE, 3) + b"images/b.png\0" + struct.pack("<Q", 2)
    points = struct.pack("<ddqddq", 1.5, 2.5, -1, 3, 4, 7)
    (folder / "images.bin").write_bytes(struct.pack("<Q", 2) + first + second + points)
    return folder


def transforms(folder: Path) -> Path:
    """A transforms.json with shared intrinsics; the second camera looks along x and stands at (1, 2, 3)."""
    looks_along_x = [[0, 0, -1, 1], [0, 1, 0, 2], [1, 0, 0, 3], [0, 0, 0, 1]]
    content = {
        "fl_x": 700, "fl_y": 710, "cx": 401, "cy": 299, "w": 800, "h": 600, "k1": -0.1, "p1": 0.001,
        "frames": [
            {"file_path": "./images/a.png", "transform_matrix": np.eye(4).tolist()},
            {"file_path": "./images/b", "transform_matrix": looks_along_x, "fl_x": 650},
        ],
    }  # fmt: skip
    path = folder / "transforms.json"
    path.write_text(json.dumps(content))
    return path


PROJECT = """# hugin project file
#hugin_ptoversion 2
p f2 w2000 h1000 v360  k0 E0 R0 n"TIFF_m c:LZW r:CROP"
m i0

# image lines
i w800 h600 f0 v60 Ra0 Eev0 r10 p20 y30 a0.01 b-0.03 c0.02 d10 e-7 g0 t0 n"C:\\pictures\\a.png"
i w800 h600 f0 v=0 Ra=0 r0 p0 y-5.5e0 TrX0 j0 a=0 b=0 c=0 d=0 e=0 g=0 t=0 n"b.png"
v r1 p1
# control points
c n0 N1 x10.5 y20 X30 Y40.25 t0
c n1 N0 x1 y2 X3 Y4 t0
c n0 N0 x1 y2 X3 Y4 t1
k i0 t0 p"0 0 99 0 99 49 0 49"
k i1 t1 p"0 0 9 0 9 9"
"""


def project(folder: Path, text: str = PROJECT) -> Path:
    """A Hugin project."""
    path = folder / "ab.pto"
    path.write_text(text)
    return path


def cameras(path: Path) -> list[Camera]:
    """Those of both pictures."""
    found = read_camera_file(path, NAMES, SIZES)
    assert all(camera is not None for camera in found)
    return [camera for camera in found if camera is not None]
