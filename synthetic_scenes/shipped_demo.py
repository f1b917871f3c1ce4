"""`edf demo --no-render`: stitches the pictures that ship with the package, where nothing can render, and compares the
cameras that were found with those that they were rendered with.

The pictures in `shipped/` are those that `edf demo` renders, as JPEG; `cameras.json` has K, R and t of each.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..core.cameras.projective import rotation_angle
from ..core.cameras.sources import CameraRequest
from ..core.output.outputs import OutputRequest, write
from ..core.pictures.picture import Picture, load_picture
from ..core.pipeline import StitchOptions, StitchResult, stitch
from ..core.system.errors import StitchError
from ..core.system.output_files import OutputFiles
from .demo import FILES, SET_FILES, SET_FOLDER, Tell, said
from .ground_truth import TrueGeometry, pose_errors
from .scene_camera import SceneCamera
from .sets.set_measures import common_rotation, numbers_of, onto
from .sets.set_stitches import equivalent_mm

SHIPPED = Path(__file__).parent / "shipped"
PAIR, ROOM = "pair", "room"
MEASURES = (
    ("rotation_deg", "rotation error", "degrees"),
    ("baseline_deg", "direction of the baseline, error", "degrees"),
    ("h_inf_px", "infinite homography, median transfer error", "px"),
    ("overlap_psnr_db", "overlap of the two pictures, PSNR", "dB"),
)
SET_MEASURES = (
    ("rotation_max_deg", "rotation error, worst of all", "degrees"),
    ("position_max_mm", "place of a camera, error, worst of all", "mm"),
    ("focal_percent", "focal length, error", "%"),
)
# Of the demo's files, those that need no true panorama.
OF_PAIR = tuple(name for name in FILES if name != "truth.png")
OF_SET = tuple(name for name in SET_FILES if name != "truth.png")


def run_shipped_demo(folder: Path, overwrite: bool, progress: Tell | None = None) -> list[str]:
    """Copies the shipped pictures into a folder, writes panoramas and reports; returns what to print."""
    tell = progress or (lambda *_: None)
    cameras = shipped_cameras()
    with OutputFiles(overwrite) as files:
        copies = [_copied(folder, name, files) for name in sorted(SHIPPED.glob("*/*.jpg"))]
        files.check_folder(folder, OF_PAIR)
        files.check_folder(folder / SET_FOLDER, OF_SET)
        of_pair = _pair(folder, cameras[PAIR], files, lambda stage, share: tell(stage, share / 2))
        of_set = _set(folder / SET_FOLDER, cameras[ROOM], files, lambda stage, share: tell(stage, (1 + share) / 2))
    left = [folder / name for name in OF_PAIR] + [folder / SET_FOLDER / name for name in OF_SET]
    return [*of_pair, *of_set, *map(str, copies), *map(str, left)]


def shipped_cameras() -> dict[str, list[SceneCamera]]:
    """The true cameras, by the folder of their pictures and in the order of these."""
    entries = json.loads((SHIPPED / "cameras.json").read_text("utf-8"))
    return {
        folder: [
            SceneCamera(np.array(one["K"]), np.array(one["R"]), np.array(one["t"]), (one["size"][0], one["size"][1]))
            for _, one in sorted(views.items())
        ]
        for folder, views in entries.items()
    }


def _copied(folder: Path, picture: Path, files: OutputFiles) -> Path:
    """Where a copy of a shipped picture goes: where a rendered one would."""
    kind = "pictures" if picture.parent.name == PAIR else "sets"
    to = folder / kind / picture.parent.name / picture.name
    files.add_to_folder(to.parent, to.name, picture.read_bytes())
    return to


def _pair(folder: Path, cameras: list[SceneCamera], files: OutputFiles, tell: Tell) -> list[str]:
    options = StitchOptions(camera=CameraRequest(focal_px=(float(cameras[0].K[0, 0]),)), measure=True)
    result = stitch([SHIPPED / PAIR / "reference.jpg", SHIPPED / PAIR / "target.jpg"], options, tell)
    measured = pose_errors(result.edges[0].two_view, TrueGeometry.of(cameras[0], cameras[1]), cameras[1].size)
    measured["overlap_psnr_db"] = result.report["measured"]["overlap_psnr_db"]
    write(result, OutputRequest(folder / "panorama.png", folder / "report.json", warp=folder / "warp.npz"), files)
    return said("Two pictures", MEASURES, measured)


def _set(folder: Path, cameras: list[SceneCamera], files: OutputFiles, tell: Tell) -> list[str]:
    paths = sorted((SHIPPED / ROOM).glob("*.jpg"))
    pictures = [_told(path, camera) for path, camera in zip(paths, cameras, strict=True)]
    result = stitch(pictures, StitchOptions(projection="cylindrical", measure=True), tell)
    files.make_folder(folder)
    write(result, OutputRequest(folder / "panorama.png", folder / "report.json"), files)
    return said(f"{len(pictures)} pictures", SET_MEASURES, _errors(result, cameras))


def _told(path: Path, camera: SceneCamera) -> Picture:
    """A picture that says what most cameras write: its 35 mm equivalent focal length."""
    picture = load_picture(path)
    return replace(picture, exif=replace(picture.exif, focal35_mm=equivalent_mm(camera)))


def _errors(result: StitchResult, cameras: list[SceneCamera]) -> dict[str, float]:
    """Found cameras of a set against the true ones."""
    rig = result.rig
    if rig is None or len(rig) < len(cameras):
        raise StitchError("the demo's set did not connect: " + " ".join(result.warnings))
    true = [cameras[number] for number in numbers_of(result)]
    gauge = common_rotation(rig.R, [camera.R for camera in true])
    places, _ = onto(rig.centres, np.array([camera.place for camera in true]))
    apart = [float(np.linalg.norm(at - camera.place)) for at, camera in zip(places, true, strict=True)]
    focals = [ours.focal / camera.K[0, 0] - 1 for ours, camera in zip(rig.cameras, true, strict=True)]
    return {
        "rotation_max_deg": max(rotation_angle(R @ gauge, camera.R) for R, camera in zip(rig.R, true, strict=True)),
        "position_max_mm": 1000 * max(apart),
        "focal_percent": 100 * max(focals, key=abs),
    }
