"""Damaged text files for `test_text_fuzz.py`: whole ones of every kind, how they are damaged, and what reads them.

Every case follows from its number.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from edf_stitch.core.batch.list import read_list
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.commands.parser import edf_parser
from edf_stitch.core.pictures.masks import read_mask
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pose.match_files import read_matches, read_matches_of_pairs

from .cameras.programs import program_files
from .cameras.programs.test_calibrations import AGISOFT, ROS, by_opencv
from .cameras.programs.test_lensfun import DATABASE, EXIF

UNKNOWN = Exif()
NAMES, SIZES = program_files.NAMES, program_files.SIZES
OURS = """{"unit": "metres", "cameras": {
 "a.png": {"K": [[700, 0, 401], [0, 710, 299], [0, 0, 1]], "distortion": [-0.1, 0.02], "R": [[1, 0, 0], [0, 1, 0],
  [0, 0, 1]], "t": [0, 0, 0], "ignore": [[[0, 0], [99, 0], [99, 49]]], "size": [800, 600]},
 "b.png": {"K": [[700, 0, 401], [0, 700, 299], [0, 0, 1]], "focal_sigma": 0.1, "start": [[0, 0, -1], [0, 1, 0],
  [1, 0, 0]], "R": [[0, 0, -1], [0, 1, 0], [1, 0, 0]], "t": [1.5, 0, 2e0],
  "lens": {"projection": "equidistant", "angular": [0.01, -0.002], "ptlens": [0.01, -0.03, 0.02], "radius_px": 300}}}}
"""
FOUND = """picture,picture2,x,y,x2,y2,weight,state,noise_px,worked_x,worked_y,worked_x2,worked_y2
a.png,b.png,10.5,20,30,40.25,1.0,used,0.5,5.0,10.0,15.0,20.0
b.png,a.png,1,2,3,4,0.0,left out by the geometry,0.5,0.5,1.0,1.5,2.0
a.png,b.png,700,500,30,40.25,1.0,used,0.5,350.0,250.0,15.0,20.0
"""
BY_HAND = "# x y x2 y2\n10.5;20;30;40\n1;2;3;4\n700.25;500;3e1;40\n"
LIST = """reference,target,name,first,last,step,focal_px,focal35,picture3
a.png,b.png,one,,,,"700 710",,
"a_%04d.png",b_####.png,clip,1,20,2,,28,
many,,,,,,,,
a.png,b.png,three,,,,700,,c.png
"""
CONFIG = """projection = "cylindrical"
focal-px = [1200, 1180]
dense = false
scale = 0.5
crop = "0,0,90,80"
ignore = {a = "mask.png"}
seed = 3
"""
# What a number, a word or a line is replaced by: what breaks parsers, sums and names.
HOSTILE = (
    "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-1", "1" * 400, "9" * 5000, "2147483648", "1e999", "0x10",
    "1,5", "\u0661", "true", "null", "[]", "{}", '""', '"', "'", "=1", "..", "../../x", "/etc/passwd", "\\", "%s%n",
    "%0999999d", "*", "[" * 2000, "<" * 50, "&lt;", "\x1b[2J", "\u202e", "\0", "x" * 20000, ",", ";", "\t", "\r", "\n",
)  # fmt: skip


class Kind(NamedTuple):
    """Files by their names, the one that is handed over first, and what reads it."""

    files: Mapping[str, bytes]
    read: Callable[[Path], Any]


def kinds(folder: Path) -> dict[str, Kind]:
    """Every kind of text that is read; made in `folder`."""

    def cameras(path: Path, exif: Exif = UNKNOWN) -> Any:
        return cameras_for(CameraRequest(cameras=path), NAMES, SIZES, (exif, exif))

    def of_text(name: str, text: str, read: Callable[[Path], Any]) -> Kind:
        return Kind({name: text.encode()}, read)

    def matches(path: Path) -> Any:
        return read_matches(path, *SIZES, names=NAMES)

    def of_several(path: Path) -> Any:
        names, sizes = (*NAMES, "c.png"), (*SIZES, (800, 600))
        return read_matches_of_pairs(path, names, sizes, [(400, 300)] * 3)

    def config(path: Path) -> Any:
        try:
            return edf_parser().parse_args(["stitch", "a.png", "b.png", "-o", "o.png", "--config", str(path)])
        except SystemExit as error:
            assert error.code == 2, "argparse refuses a wrong call so"
            return None

    made = {
        "ours": of_text("cameras.json", OURS, cameras), "found": of_text("m.csv", FOUND, matches),
        "several": of_text("m.csv", FOUND, of_several), "by hand": of_text("m.csv", BY_HAND, matches),
        "list": of_text("list.csv", LIST, read_list), "config": of_text("c.toml", CONFIG, config),
        "hugin": of_text("ab.pto", program_files.PROJECT, cameras),
        "hugin's points": of_text("ab.pto", program_files.PROJECT, matches),
        "ros": of_text("ros.yaml", ROS, cameras), "agisoft": of_text("agisoft.xml", AGISOFT, cameras),
        "lensfun": of_text("lensfun.xml", DATABASE, lambda path: cameras(path, EXIF)),
        "transforms": Kind({"transforms.json": program_files.transforms(folder).read_bytes()}, cameras),
    }  # fmt: skip
    for name in ("opencv.yml", "opencv.xml"):
        made[name] = Kind({name: by_opencv(folder / name).read_bytes()}, cameras)
    for ending, write in ((".txt", program_files.colmap_text), (".bin", program_files.colmap_binary)):
        for model in ("OPENCV", "OPENCV_FISHEYE"):
            write(folder, model)
            files = {name + ending: (folder / (name + ending)).read_bytes() for name in ("images", "cameras")}
            made[f"colmap{ending} {model}"] = Kind(files, cameras)
    mask = cv2.imencode(".png", np.pad(np.full((20, 30), 255, np.uint8), 40))[1].tobytes()
    made["mask"] = Kind({"mask.png": mask}, lambda path: read_mask(path, (110, 100), "the reference"))
    return made


def damaged(data: bytes, chance: random.Random) -> bytes:
    """One to three injuries: of bytes, of numbers and words, or of lines."""
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        data = chance.choice((_bytes_hurt, _word_hurt, _word_hurt, _lines_hurt))(data, chance)
    return data


def _bytes_hurt(data: bytes, chance: random.Random) -> bytes:
    at, to = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    return chance.choice((
        lambda: data[:at],
        lambda: data[:at] + data[to:],
        lambda: data[:at] + bytes(chance.randrange(256) for _ in range(chance.choice((1, 2, 8)))) + data[at:],
        lambda: data[:at] + bytes(256 - (one or 1) & 255 for one in data[at : at + 8]) + data[at + 8 :],
        lambda: data[:at] + chance.choice((b"\0", b"\xff", b"\x7f")) * 8 + data[at + 8 :],
        lambda: data[:to] + data[at:],
        lambda: data + data,
    ))()  # fmt: skip


def _word_hurt(data: bytes, chance: random.Random) -> bytes:
    words = list(re.finditer(rb"[-+\w.]+|\"[^\"]*\"", data))
    if not words:
        return data
    word = chance.choice(words)
    other = chance.choice([chance.choice(HOSTILE).encode(), data[slice(*chance.choice(words).span())]])
    return data[: word.start()] + other + data[word.end() :]


def _lines_hurt(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    at, to = (chance.randrange(len(lines)) for _ in range(2))
    if chance.random() < 0.3:
        lines[at], lines[to] = lines[to], lines[at]
    elif chance.random() < 0.5:
        del lines[at]
    else:
        lines[at:at] = [lines[to]] * chance.choice((1, 2, 500))
    return b"\n".join(lines)


def case(whole: Mapping[str, Kind], number: int, folder: Path) -> tuple[str, Callable[[], Any]]:
    """The kind of case `number`, and what reads its file."""
    chance = random.Random(number)
    name = list(whole)[number % len(whole)]
    kind = whole[name]
    for old in folder.iterdir():
        old.unlink()
    hurt = chance.choice(list(kind.files))
    for file, data in kind.files.items():
        (folder / file).write_bytes(damaged(data, chance) if file == hurt else data)
    return name, lambda: kind.read(folder / next(iter(kind.files)))
