"""Messages of the engine in the panel's words."""

import ast
import re
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")
switches = pytest.importorskip("edf_stitch.edf_addon.switches")
from edf_stitch.edf_addon import explain  # noqa: E402
from edf_stitch.edf_addon.panels import sidebar  # noqa: E402

CORE = Path(__file__).resolve().parents[2] / "core"
# Rooms that a stitch from the panel does not come to, or of whose words only pages and help are made.
ELSEWHERE = ("commands", "batch", "compare", "output")
# Switches of messages about what the panel never asks for.
NEVER_ASKED = {"require-all", "scale-metres", "principal", "overwrite", "memory", "brackets", "ignore"}


def messages() -> list[str]:
    """All texts of the engine that name a switch; docstrings are for programmers."""
    found = []
    for path in CORE.rglob("*.py"):
        if path.relative_to(CORE).parts[0] in ELSEWHERE:
            continue
        tree = ast.parse(path.read_text("utf-8"))
        docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        found += [
            node.value for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings
            and re.search(r"--[a-z]", node.value)
        ]  # fmt: skip
    return found


def test_no_message_that_the_panel_can_show_names_a_switch():
    texts = messages()
    assert len(texts) > 20
    left = {name for text in texts for name in re.findall(r"--([a-z][a-z0-9-]*)", switches.in_the_panel(text))}
    assert left <= NEVER_ASKED


def test_every_setting_has_the_label_and_the_place_that_the_panel_gives_it(blender):
    headings = {panel.bl_label for panel in sidebar.PANELS}
    for switch, setting in switches.SETTINGS.items():
        prop = blender.settings.bl_rna.properties[setting.name]
        assert (prop.name, setting.panel in headings) == (setting.label, True), switch
        if setting.choices:
            assert {one[0] for one in setting.choices} == set(prop.enum_items.keys())


@pytest.mark.parametrize(("said", "shown"), [
    ("choose --fade continue", "Choose Outside ▸ Continue under Field."),
    ("--projection equirectangular shows them whole", "Projection ▸ Equirectangular under Frame shows them whole."),
    ("give it (--focal35, --focal-px) if you know it", "Give it (Focal Length under Camera) if you know it."),
    ("keep the reference's place (--slide 0)", "Keep the reference's place (Viewpoint 0 under Frame)."),
    ("make it darker (--exposure=-1)", "Make it darker (Brighter -1 under Output)."),
    ("use smaller pictures, or --scale", "Use smaller pictures, or Scale under Output."),
    ("--exr-depth float keeps them", "Float Depth ▸ Float under Output keeps them."),
    ("a message without any", "A message without any."),
])  # fmt: skip
def test_what_is_said(said, shown):
    assert explain.sentence(said) == shown
