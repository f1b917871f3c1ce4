"""What docs/blender.md shows from Python runs as it stands there."""

import re
import shutil
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.scene import take_along  # noqa: E402

PAGE = Path(__file__).resolve().parents[2] / "docs" / "blender.md"


def test_the_snippet_stitches_files_and_takes_cameras_and_surface_along(blender, folder, tmp_path):
    (block,) = re.findall(r"((?:^ {4}.*\n)+)", PAGE.read_text("utf-8").partition("## From Python")[2], re.MULTILINE)
    for name, source in (("left.jpg", "reference.png"), ("right.jpg", "target.png")):
        shutil.copy(folder / source, tmp_path / name)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    exec("\n".join(line[4:] for line in block.splitlines()), {})
    settings = bpy.context.scene.edf_stitch
    assert [entry.image.name for entry in settings.pictures] == ["left.jpg", "right.jpg"]
    assert (tmp_path / "panorama.png").is_file() and take_along.find(settings.result, "MESH") is not None
    assert take_along.find(settings.result, "RIG").matrix_world.translation.z == pytest.approx(1.6, abs=0.5)
    assert bpy.ops.edf.stitch(images="left.jpg\nright.jpg") == {"FINISHED"}


def test_a_name_that_no_image_has_and_a_file_that_is_not_there_are_said(blender, tmp_path):
    with pytest.raises(RuntimeError, match="no image named “nobody”"):
        bpy.ops.edf.stitch(images="nobody")
    with pytest.raises(RuntimeError, match="gone.jpg cannot be opened"):
        bpy.ops.edf.stitch(filepaths=str(tmp_path / "gone.jpg"))
