"""Tables and page from a summary: what is best, medians, what is missing, and nothing that a browser would run."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

import pytest
from edf_stitch.core.choices import FIELDS
from edf_stitch.core.compare.options import COMPARISON
from edf_stitch.core.compare.page import comparison_page
from edf_stitch.core.compare.published import published
from edf_stitch.core.compare.tables import (
    best,
    comparison_csv,
    comparison_markdown,
    document,
    medians,
    shown,
    timing_markdown,
)


def entry(name: str, **psnr: float | None) -> dict[str, Any]:
    fields = {
        field: {
            "status": "failed" if value is None else "done", "message": "too | few" if value is None else "",
            "figures": {} if value is None else {
                "overlap_psnr_db": value, "overlap_ssim": value / 40, "folds": 0.001, "projectivity_px": math.nan,
                "canvas_psnr_db": value + 3, "canvas_ssim": 0.9,
            },
            "pictures": {kind: f"pictures/{name}/{field}-{kind}.jpg"
                         for kind in ("panorama", "average", "difference", "warped", "reference")},
        }
        for field, value in psnr.items()
    }  # fmt: skip
    return {
        "name": name, "reference": "a.png", "target": "b.png", "status": "done", "message": "", "fields": fields,
        "published": published(name), "size": [640, 480], "target_size": [640, 480], "model": "general", "why": "",
        "matches": 200, "inliers": 180, "focal_source": "EXIF", "rendered": False,
    }  # fmt: skip


def failed(name: str) -> dict[str, Any]:
    return {"name": name, "reference": "a.png", "target": "b.png", "status": "failed", "published": {}, "fields": {},
            "message": "no <content> in common"}  # fmt: skip


def summary(*pairs: dict[str, Any], fields: tuple[str, ...] = ("slack", "rew")) -> dict[str, Any]:
    return {"schema": 1, "version": "1.2.3", "fields": list(fields), "pairs": list(pairs),
            "sets": {"fields": [], "pairs": []}}  # fmt: skip


def test_the_best_is_marked_and_equals_share_it() -> None:
    assert best(entry("a", slack=20.0, rew=21.0), ("slack", "rew"), "overlap_psnr_db") == {"rew"}
    assert best(entry("a", slack=20.001, rew=20.0), ("slack", "rew"), "overlap_psnr_db") == {"slack", "rew"}
    assert best(entry("a", slack=20.0, rew=21.0), ("slack", "rew"), "canvas_psnr_db") == set(), "information only"
    text = comparison_markdown(summary(entry("a", slack=20.0, rew=21.0)))
    assert "| a (640×480) | 20.00 / 0.500 | **21.00** / **0.525** |" in text


def test_medians_are_over_the_pairs_that_all_fields_have() -> None:
    lacking = entry("b", slack=10.0, rew=None)
    whole = summary(entry("a", slack=20.0, rew=30.0), lacking, entry("c", slack=22.0, rew=20.0))
    assert medians(whole, "overlap_psnr_db") == {"slack": 21.0, "rew": 25.0}
    assert medians(whole, "projectivity_px") == {"slack": None, "rew": None}
    assert "| median | 21.00 / 0.525 | 25.00 / 0.625 |" in comparison_markdown(whole)


def test_what_failed_says_why() -> None:
    text = comparison_markdown(summary(entry("a", slack=20.0, rew=None), failed("b")))
    assert "- a, rew: too | few" in text and "- b: no <content> in common" in text and "| b | – / – | – / – |" in text
    rows = list(csv.DictReader(io.StringIO(comparison_csv(summary(entry("a", slack=20.0, rew=None), failed("b"))))))
    assert [(row["pair"], row["field"], row["status"], row["why"]) for row in rows] == [
        ("a", "slack", "done", ""), ("a", "rew", "failed", "too | few"), ("b", "", "failed", "no <content> in common"),
    ]  # fmt: skip
    assert rows[0]["overlap_psnr_db"] == "20.0" and rows[0]["projectivity_px"] == "" == rows[1]["overlap_psnr_db"]


def test_no_name_is_a_formula_in_the_table_for_spreadsheets() -> None:
    hostile = entry("=1+1", slack=20.0) | {"reference": "@a.png", "target": "a\n=b.png"}
    (row,) = csv.DictReader(io.StringIO(comparison_csv(summary(hostile))))
    assert (row["pair"], row["reference"], row["target"]) == ("./=1+1", "./@a.png", "a\\n=b.png")


def test_shares_are_shown_in_percent_and_nothing_as_a_dash() -> None:
    assert shown(0.00123, "folds") == "0.123" and shown(math.nan, "folds") == shown(None, "folds") == "–"


def test_published_values_stand_beside_ours_for_pairs_of_the_literature_only() -> None:
    assert published("DHW-temple")["paper"]["EDF"] == (0.943, 30.24, 7.2) and not published("my garden")
    text = comparison_markdown(summary(entry("DHW-temple", slack=24.0, rew=23.0)))
    assert "30.24 / 0.943; 7.2 px" in text and "27.00 / 0.900" in text and "Hugin 19.64 / 0.424" in text
    assert "Hugin" not in comparison_markdown(summary(entry("mine", slack=24.0, rew=23.0)))


def test_seconds_have_a_table_of_their_own() -> None:
    assert "| a | 1.50 | – |" in timing_markdown({"a": {"registration": 1.5}, "b": {"rew": 2.0}})
    whole = summary(entry("a", slack=20.0, rew=21.0))
    assert not any("second" in text.lower() for text in (comparison_markdown(whole), comparison_csv(whole)))


def test_the_page_loads_nothing_from_elsewhere_and_escapes_names() -> None:
    page = comparison_page(summary(entry("temple <b>", slack=20.0, rew=None), failed("desk")))
    assert page.count("<script") == 1 and "http:" not in page and "https:" not in page and "default-src 'none'" in page
    assert "temple <b>" not in page and "temple &lt;b&gt;" in page
    assert "no &lt;content&gt; in common" in page and "1 pairs and sets compared, 1 not" in page
    assert 'src="pictures/temple%20%3Cb%3E/slack-warped.jpg"' in page and "rew-warped" not in page


def test_a_loupe_is_over_each_panorama_and_knows_where_the_reference_lies() -> None:
    one = entry("a", slack=20.0, rew=21.0)
    one["fields"]["slack"]["origin"] = [10.5, 20.25, 0.5]
    page = comparison_page(summary(one))
    assert page.count("<figure data-loupe=") == 2 and 'data-loupe="10.5000 20.2500 0.5000"' in page
    assert 'data-loupe=""' in page, "places of others are shares of the picture"


def test_a_document_tells_when_and_with_what_it_was_made_and_how_long_each_field_took() -> None:
    whole = summary(entry("a", slack=20.0, rew=21.0))
    seconds = {"a": {"registration": 1.5, "slack: alignment": 2.0, "slack: composition": 0.5, "rew: alignment": 1.0}}
    text = document(whole, seconds, "2026-11-30, EDF Stitch 1.2.3")
    assert "2026-11-30, EDF Stitch 1.2.3" in text and "| a | 1.50 | 2.50 | 1.00 |" in text
    assert "20.00 / " in text and text.startswith("# Compared with others")


@pytest.mark.parametrize("fields", [("slack", "rew"), FIELDS])
def test_every_field_can_be_chosen_to_blink(fields: tuple[str, ...]) -> None:
    page = comparison_page(summary(entry("a", **dict.fromkeys(fields, 20.0)), fields=fields))
    assert page.count('type="radio"') == len(fields) <= COMPARISON.max_fields and page.count(" checked>") == 1
    assert page.count('alt="reference"') == len(fields)
    for k in range(1, len(fields) + 1):
        assert f"input:nth-of-type({k}):checked ~ .stacks > div:nth-child({k})" in page
