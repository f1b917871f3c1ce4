"""One undo takes back what an operator did, all of it, and one redo does it again: of every operator."""

from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import properties  # noqa: E402
from edf_stitch.edf_addon.bridge import result  # noqa: E402
from edf_stitch.edf_addon.idnames import Operator  # noqa: E402
from edf_stitch.edf_addon.scene import take_along  # noqa: E402

from ..scene.conftest import stitched  # noqa: E402, F401 (a fixture)

FOLDER = "folder"  # stands for that of two pictures
FILE = [{"name": "reference.png"}]
PAIR = [*FILE, {"name": "target.png"}]
# What is called, with what, and what before it.
STEPS = {
    Operator.ADD_PICTURES: ({"directory": FOLDER, "files": FILE}, ()),
    Operator.ADD_FOLDER: ({"directory": FOLDER}, ()),
    Operator.ADD_IMAGES: ({"which": "FILE"}, (Operator.CLEAR_PICTURES,)),
    Operator.OPEN_PAIR: ({"directory": FOLDER, "files": PAIR}, ()),
    Operator.REMOVE_PICTURE: ({}, ()),
    Operator.MOVE_PICTURE: ({"way": "DOWN"}, ()),
    Operator.CLEAR_PICTURES: ({}, ()),
    Operator.SEE_FROM: ({"row": 1}, ()),
    Operator.ADD_CLIPS: ({"directory": FOLDER, "files": FILE}, ()),
    Operator.REMOVE_CLIP: ({"row": 0}, (Operator.ADD_CLIPS,)),
    Operator.SWAP: ({}, ()),
    Operator.RESET: ({}, (Operator.REFERENCE_FRAME,)),
    Operator.REFERENCE_FRAME: ({}, ()),
    Operator.MATCH_ADD: ({"point": (10, 20), "target_point": (30, 40)}, ()),
    Operator.MATCH_DELETE: ({"which": "ALL"}, (Operator.MATCH_ADD,)),
    Operator.MATCH_ENABLE: ({"action": "INVERT", "which": "ALL"}, (Operator.MATCH_ADD,)),
    Operator.MASK_PAINT: ({"side": "reference"}, ()),
    Operator.PICTURE_MASK: ({"row": 1, "kind": "show"}, ()),
    Operator.PICTURE_MASK_REMOVE: ({"row": 1, "kind": "show"}, (Operator.PICTURE_MASK,)),
    Operator.TAKE_FROM: ({"picture": 1, "place": (200.0, 150.0), "radius": 20.0}, ()),
    Operator.PLACE_REMOVE: ({}, (Operator.TAKE_FROM,)),
    Operator.GUIDE_ADD: ({"kind": "VERTICAL", "picture": 1, "ends": (50.0, 20.0, 60.0, 160.0)}, ()),
    Operator.GUIDE_REMOVE: ({}, (Operator.GUIDE_ADD,)),
    Operator.CREATE_CAMERAS: ({"look": True}, ()),
    Operator.DEPTH_MESH: ({}, ()),
    Operator.BACKPLATE: ({}, ()),
    Operator.SET_DISTANCE: ({"distance": 7.0}, (Operator.CREATE_CAMERAS,)),
    Operator.LOOK_THROUGH: ({"role": "REFERENCE"}, (Operator.CREATE_CAMERAS,)),
}  # fmt: skip
# Those that are held elsewhere, or that leave the file as it was.
ELSEWHERE = {
    **dict.fromkeys((Operator.STITCH, Operator.ENVIRONMENT, Operator.SPHERE, Operator.USE_AS_WORLD,
                     Operator.DEVELOP), "jobs/test_stitching_sets, on a panorama of its own"),
    **dict.fromkeys((Operator.PREVIEW, Operator.RESTITCH, Operator.STITCH_FILES), "made as a stitch is"),
    **dict.fromkeys((Operator.FOLLOW, Operator.FRAME_DRAG), "end_to_end/test_set_in_window"),
    **dict.fromkeys((Operator.STITCH_CLIPS, Operator.CLIP_FRAMES), "files on the disk, which no undo takes back"),
    Operator.RESTORE: "test_ownership",
    **dict.fromkeys((Operator.MATCH_EDIT, Operator.POINTER, Operator.CANCEL, Operator.PICTURE_STATE, Operator.SAVE,
                     Operator.MASK_DONE, Operator.PRESET_ADD), "nothing of the file changes"),
}  # fmt: skip


def call(name: Operator, folder: Path, **given) -> None:
    """As a click does: with a step for undo, where the operator makes one."""
    given = {key: str(folder) if value == FOLDER else value for key, value in given.items()}
    operator = getattr(bpy.ops.edf, name.partition(".")[2])
    assert operator("EXEC_DEFAULT", True, **given) == {"FINISHED"}, name


def told() -> dict:
    """What an artist finds in the file."""
    scene = bpy.context.scene
    settings = scene.edf_stitch
    kinds = ("images", "objects", "cameras", "meshes", "worlds", "movieclips", "collections", "materials")
    lists = ("pictures", "matches", "guides", "places", "clips")
    return {
        **{kind: sorted(one.name for one in getattr(bpy.data, kind)) for kind in kinds},
        **{name: [_fields(entry) for entry in getattr(settings, name)] for name in lists},
        "settings": properties.keep(settings),
        "pointers": {name: _plain(one) for name, one in properties.pointers(settings).items()},
        "scene": [_plain(value) for value in (scene.camera, scene.world, scene.render.resolution_x,
                                              scene.render.resolution_y, scene.render.film_transparent)],
        "places of objects": {one.name: [tuple(row) for row in one.matrix_basis] for one in scene.objects},
    }  # fmt: skip


def _fields(entry) -> dict:
    return {one.identifier: _plain(getattr(entry, one.identifier)) for one in entry.bl_rna.properties
            if one.identifier != "rna_type"}  # fmt: skip


def _plain(value) -> object:
    return getattr(value, "name", tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value)


def test_every_operator_is_named_here():
    assert STEPS.keys() | ELSEWHERE.keys() == set(Operator) and not STEPS.keys() & ELSEWHERE.keys()


@pytest.mark.parametrize("name", STEPS)
def test_one_undo_takes_it_back_and_one_redo_does_it_again(stitched, monkeypatch, folder, name):  # noqa: F811
    known = stitched
    monkeypatch.setattr(result, "read", lambda image: known if image is not None and image.name == "result" else None)
    bpy.context.preferences.edit.use_global_undo = True
    given, before = STEPS[name]
    for one in before:
        call(one, folder, **STEPS[one][0])
    if name == Operator.SET_DISTANCE:
        panorama = bpy.context.scene.edf_stitch.result
        take_along.select(bpy.context, [take_along.find(panorama, role) for role in ("REFERENCE", "TARGET")])
        bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="before")
    first = told()
    call(name, folder, **given)
    then = told()
    assert then != first
    bpy.ops.ed.undo()
    assert told() == first
    bpy.ops.ed.redo()
    assert told() == then
