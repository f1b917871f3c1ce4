"""What the panel says of the focal length before the stitch is what the engine takes."""

import struct

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.core.pictures.encoding import encode_picture  # noqa: E402
from edf_stitch.core.pictures.picture import load_picture  # noqa: E402
from edf_stitch.edf_addon.bridge import photo  # noqa: E402


def saved(path, app1: bytes = b""):
    """A black picture of 40 × 30 px, with a segment behind a JPEG's first marker."""
    data = encode_picture(np.zeros((30, 40, 3), np.float32), None, 8, path.suffix)[0]
    path.write_bytes(data[:2] + app1 + data[2:] if app1 else data)
    return bpy.data.images.load(str(path))


def exif_segment(focal35: int, orientation: int = 1) -> bytes:
    """As a camera would have written it: orientation, and one tag, 0xA405, in the EXIF folder of a TIFF structure."""
    folder = struct.pack("<H HHLHH HHLL L", 2, 0x0112, 3, 1, orientation, 0, 0x8769, 4, 1, 38, 0)
    exif = struct.pack("<H HHLHH L", 1, 0xA405, 3, 1, focal35, 0, 0)
    block = b"Exif\0\0II*\0\x08\0\0\0" + folder + exif
    return b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block


def test_exif_is_said_with_its_value(blender, tmp_path):
    image = saved(tmp_path / "a.jpg", exif_segment(28))
    assert load_picture(tmp_path / "a.jpg").exif.focal35_mm == 28, "the engine reads it too"
    expected = 28 * np.hypot(40, 30) / np.hypot(36, 24)
    assert photo.camera_words(image, "reference") == f"Reference: {expected:.0f} px, EXIF 35 mm equivalent"


@pytest.mark.parametrize("packed", [False, True])
def test_a_photograph_held_upright_is_known_to_be_stored_lying(blender, tmp_path, packed):
    image = saved(tmp_path / "a.jpg", exif_segment(28, orientation=6))
    if packed:
        image.pack()
        (tmp_path / "a.jpg").unlink()
    assert tuple(image.size) == (40, 30), "Blender shows it as it is stored"
    assert photo.orientation(image) == 6 and photo.upright_size(image) == (30, 40)
    assert "EXIF 35 mm" in photo.camera_words(image, "reference")


@pytest.mark.parametrize("kind", ["no EXIF", "generated", "file gone", "nothing chosen"])
def test_without_exif_it_says_what_happens_instead(blender, tmp_path, kind):
    image = None
    if kind == "generated":
        image = bpy.data.images.new("g", 40, 30)
    elif kind != "nothing chosen":
        image = saved(tmp_path / "a.png")
    if kind == "file gone":
        (tmp_path / "a.png").unlink()
    said = photo.camera_words(image, "target")
    assert said == ("Target: not chosen yet" if image is None else "Target: no EXIF, found from the matches")
