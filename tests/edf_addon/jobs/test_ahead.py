"""What the first click needs is loaded before it."""

import subprocess
import sys

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.jobs import ahead  # noqa: E402


@pytest.mark.skipif(bool(bpy.app.binary_path), reason="a whole Blender's Python has no bpy of its own")
def test_adding_a_folder_and_starting_a_stitch_load_nothing_of_the_engine_that_was_not_loaded_ahead(tmp_path):
    """In a process of its own: here all is loaded already."""
    script = tmp_path / "loaded.py"
    script.write_text(f"""
import sys
import bpy, edf_stitch
edf_stitch.register()
from edf_stitch.edf_addon.jobs import ahead, job, stitching
from edf_stitch.edf_addon import pictures
ahead.load().join()
before = {{name for name in sys.modules if ".core." in name}}
assert before
import pathlib
folder = {str(tmp_path)!r}
for name in "abc":
    image = bpy.data.images.new(name, 8, 8)
    image.filepath_raw, image.file_format = folder + "/" + name + ".png", "PNG"
    image.save()
bpy.ops.edf.add_folder(directory=folder)
assert len(bpy.context.scene.edf_stitch.pictures) == 3
stitching.make_job(bpy.context, pathlib.Path(folder))
late = {{name for name in sys.modules if ".core." in name}} - before
assert not late, late
print("all was loaded")
edf_stitch.unregister()
""")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120, check=False)
    assert "all was loaded" in done.stdout, done.stderr[-2000:]


def test_every_module_that_is_loaded_ahead_is_there():
    thread = ahead.load()
    thread.join()
    assert all(f"{ahead.PACKAGE}.core.{name}" in sys.modules for name in ahead.MODULES)
