"""The switches of the command line that the engine's messages name, as an artist finds them in the panel. No bpy."""

from __future__ import annotations

import re
from dataclasses import dataclass

from . import offered


@dataclass(frozen=True)
class Setting:
    """Where a switch is in the panel: `label` of the property `name`, under the heading `panel`; `choices`: what it
    offers (see `offered`)."""

    name: str
    label: str
    panel: str
    choices: tuple[tuple, ...] = ()


SETTINGS = {
    "field": Setting("field", "Field", "Field", offered.FIELDS),
    "fade": Setting("fade", "Outside", "Field", offered.FADES),
    "projection": Setting("projection", "Projection", "Frame", offered.PROJECTIONS),
    "slide": Setting("slide", "Viewpoint", "Frame"),
    "centre": Setting("centre", "Centre", "Frame"),
    "fov": Setting("fov", "Field of View", "Frame"),
    "level": Setting("level", "Level", "Frame", offered.LEVELS),
    "crop": Setting("crop", "Crop", "Frame", offered.CROPS),
    "exposure": Setting("light_stops", "Brighter", "Output"),
    "holes": Setting("holes", "Holes", "Output", offered.HOLES),
    "exr-depth": Setting("exr_depth", "Float Depth", "Output", offered.EXR_DEPTHS),
    "scale": Setting("scale", "Scale", "Output"),
    "mask": Setting("seam_mask", "Painted Seam", "Masks"),
    "ignore-ref": Setting("ignore_reference", "Ignore in Reference", "Masks"),
    "ignore-target": Setting("ignore_target", "Ignore in Target", "Masks"),
    "matches": Setting("edited_matches", "Use These Matches", "Matches"),
    "focal-px": Setting("focal_px", "Focal Length", "Camera"),
    "focal35": Setting("focal35", "Focal Length", "Camera"),
    "focal-mm": Setting("focal", "Focal Length", "Camera"),
    "sensor-mm": Setting("sensor", "Sensor Width", "Camera"),
}
# What is no single setting; longer ones first.
PHRASES = {
    "--focal35, --focal-px": "Focal Length under Camera",
    "--focal-px, --focal35": "Focal Length under Camera",
    "--ignore-ref, --ignore-target": "Masks",
    "--ignore NAME=MASK": "Never Use under Masks",
    "--show": "Use Here under Masks",
    "--brackets off": "a list without them",
    "--cameras FILE.json": "a camera file on the command line",
    "--cameras": "a camera file on the command line",
    "--viewpoint centre": "another row of the list",
    "--viewpoint": "the camera in a row of the list",
    "--memory allows": "the command line's --memory allows",
}


def in_the_panel(text: str) -> str:
    """A message of the engine, with the panel's labels in place of the command line's switches."""
    kept = {}
    for number, (phrase, words) in enumerate(PHRASES.items()):
        mark = f"\0{number}\0"
        text, kept[mark] = text.replace(phrase, mark), words
    text = re.sub(r"--([a-z][a-z0-9-]*)(?:([ =])(-?[\d.]*\d|[a-z]+))?", _found, text)
    for mark, words in kept.items():
        text = text.replace(mark, words)
    return text


def _found(switch: re.Match[str]) -> str:
    """What a switch, with the word behind it, is in the panel."""
    setting = SETTINGS.get(switch[1])
    if setting is None:
        return switch[0]
    where, word = f"under {setting.panel}", switch[3]
    if word is None:
        return f"{setting.label} {where}"
    for identifier, name, *_ in setting.choices:
        if identifier.lower() == word:
            return f"{setting.label} ▸ {name} {where}"
    if not setting.choices and not word.isalpha():
        return f"{setting.label} {word} {where}"
    return f"{setting.label} {where}{switch[2]}{word}"
