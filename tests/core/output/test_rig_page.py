"""The page about a set: each picture and each pair is there, and what is doubtful can be read."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.output.options import GRAPH
from edf_stitch.core.output.rig_graph import laid_out, rig_graph
from edf_stitch.core.output.rig_page import rig_page
from edf_stitch.core.pictures.picture import Picture, picture_from_array

from ..rig.known_rigs import known_rig

NAMES = ("a<1>.jpg", "b.jpg", "c.jpg", "d.jpg")


@pytest.fixture(scope="module")
def pictures() -> tuple[Picture, ...]:
    noise = np.random.default_rng(0).integers(0, 255, (4, 30, 40, 3)).astype(np.uint8)
    return tuple(picture_from_array(one, name) for one, name in zip(noise, NAMES, strict=True))


@pytest.fixture(scope="module")
def rig() -> Rig:
    rig, _ = known_rig(4)
    return replace(rig, edges=(*rig.edges[:-1], replace(rig.edges[-1], baseline="continuity")))


def test_each_picture_stands_on_the_sheet_and_each_pair_is_a_line(pictures: tuple[Picture, ...], rig: Rig) -> None:
    svg = ElementTree.fromstring(rig_graph(pictures, rig))
    assert [one.text for one in svg.findall("text")] == list(NAMES) and len(svg.findall("image")) == 4
    lines = svg.findall("line")
    told = {line.findtext("title"): line for line in lines}
    assert set(told) == {
        f"{NAMES[edge.i]} – {NAMES[edge.j]}: {edge.inliers} of {edge.matches} matches" for edge in rig.edges
    }
    widths = [float(line.attrib["stroke-width"]) for line in lines]
    assert widths == sorted(widths) and widths[0] < widths[-1] == GRAPH.thickest_px
    dashed = [title for title, line in told.items() if "stroke-dasharray" in line.attrib]
    last = rig.edges[-1]
    assert dashed == [f"{NAMES[last.i]} – {NAMES[last.j]}: {last.inliers} of {last.matches} matches"]


def test_pictures_stand_where_they_look_to_and_none_upon_another(rig: Rig) -> None:
    places = laid_out(rig)
    assert (np.diff(places[:, 0]) > 0).all(), "each looks further right than the one before"
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)[~np.eye(4, dtype=bool)]
    assert apart.min() > GRAPH.thumbnail_px
    alike = laid_out(replace(rig, R=np.tile(np.eye(3), (4, 1, 1))))
    assert len(np.unique(alike.round(3), axis=0)) == 4


def page(pictures: tuple[Picture, ...], rig: Rig, **of_rig: Any) -> str:
    camera = {"focal_px": 380.0, "focal_deviation": 0.012, "source": "EXIF"}
    report = {
        "verdict": {"is": "look at it", "because": "a link is weak", "what_to_do": "take more"},
        "pictures": [
            {"name": name, "camera": camera, "place": [0.0, 0.1, 0.2], "place_deviation": None, "inliers": 99,
             "residual_px": 0.25, "hidden_px": 7, "share": 0.4} for name in NAMES
        ],
        "left_out": [{"name": "e.jpg", "why": "connects to no other picture"}],
        "rig": {
            "edges": [
                {"pictures": [NAMES[edge.i], NAMES[edge.j]], "matches": edge.matches, "inliers": edge.inliers,
                 "noise_px": 0.5, "parallax_px": 3.0, "off_degrees": 0.01, "baseline": edge.baseline}
                for edge in rig.edges
            ],
            "points": 300, "scale": "measured", "loop_degrees": None, "stations": [], "focal_guesses": [], **of_rig,
        },
    }  # fmt: skip
    panorama = SimpleNamespace(pixels=np.zeros((20, 60, 3), np.float32), alpha=np.ones((20, 60), np.float32))
    said = {"pictures": pictures, "warnings": ["mind the gap"], "panorama": panorama}
    result: Any = SimpleNamespace(rig=rig, report=report, **said)
    return rig_page(result)


def test_the_page_has_each_picture_each_pair_and_who_is_left_out(pictures: tuple[Picture, ...], rig: Rig) -> None:
    html = page(pictures, rig)
    assert html.count("<svg") == 1 and "mind the gap" in html and "look at it: a link is weak. take more" in html
    rows = [re.sub("<[^>]+>", " ", row) for row in re.findall("<tr><th>.*?</tr>", html)]
    for name in ("a&lt;1&gt;.jpg", *NAMES[1:]):
        assert any(row.split()[0] == name and "1.20%" in row and "not known" in row for row in rows)
    assert all(f"{edge.matches} {edge.inliers}" in " ".join(" ".join(rows).split()) for edge in rig.edges)
    assert "e.jpg: connects to no other picture" in html and "<1>" not in html


def test_what_holds_the_pictures_together_is_told(pictures: tuple[Picture, ...], rig: Rig) -> None:
    plain = page(pictures, rig)
    assert "300 points, of which three pictures see enough" in plain
    assert not any(word in plain for word in ("worst loop", "Taken from one place", "almost alike"))
    guesses = [{"focal_px": 381.26, "k1": 0.0, "cost": 0.08812}, {"focal_px": 392.4, "k1": 0.01, "cost": 0.0912}]
    told = page(pictures, rig, scale="continuity", loop_degrees=0.123, stations=[["b.jpg", "c.jpg"]],
                focal_guesses=guesses)  # fmt: skip
    for words in ("only guessed", "miss closing by 0.12°", "Taken from one place: b.jpg, c.jpg.",
                  "381.3 px at 0.0881 px²; 392.4 px at 0.0912 px²"):  # fmt: skip
        assert words in told
