"""The sensor table: names as EXIF has them, and neighbours in name that are other cameras."""

from __future__ import annotations

import pytest
from edf_stitch.core.cameras.sensors import sensor_diagonal

APS_C, CANON_APS_C, FULL_FRAME, ONE_INCH = 28.2, 26.8, 43.27, 15.86


@pytest.mark.parametrize(
    "make, model, diagonal",
    [
        ("Apple", "iPhone 7", 6.0),
        ("Apple", "iPhone 4S", 5.68),
        ("Apple", "iPhone XS Max", 7.06),
        ("Google", "Pixel 3a", 7.18),
        ("Canon", "Canon EOS 5D Mark III", FULL_FRAME),
        ("Canon", "Canon EOS R5", FULL_FRAME),
        ("Canon", "Canon EOS R50", CANON_APS_C),
        ("Canon", "Canon EOS 700D", CANON_APS_C),
        ("Canon", "Canon EOS REBEL T3i", CANON_APS_C),
        ("Canon", "Canon PowerShot G7 X Mark II", ONE_INCH),
        ("SONY", "ILCE-7M3", FULL_FRAME),
        ("SONY", "ILCE-6000", APS_C),
        ("SONY", "ILCE-1", FULL_FRAME),
        ("SONY", "DSC-RX1", FULL_FRAME),
        ("SONY", "DSC-RX100M3", ONE_INCH),
        ("SONY", "SLT-A99V", FULL_FRAME),
        ("SONY", "SLT-A77V", APS_C),
        ("Panasonic", "DMC-FZ1000", ONE_INCH),
        ("Panasonic", "DMC-FZ72", 7.66),
        ("Panasonic", "DMC-LX100", 19.2),
        ("OLYMPUS CORPORATION", "E-M10MarkII", 21.64),
        ("FUJIFILM", "X-T2", APS_C),
        ("FUJIFILM", "X100F", APS_C),
        ("RICOH IMAGING COMPANY, LTD.", "PENTAX K-1 Mark II", FULL_FRAME),
        ("RICOH IMAGING COMPANY, LTD.", "PENTAX K-3", APS_C),
        ("NIKON CORPORATION", "NIKON Z 6", FULL_FRAME),
        ("NIKON CORPORATION", "NIKON Z 50", APS_C),
        ("NIKON CORPORATION", "NIKON Z fc", APS_C),
    ],
)
def test_makers_figures(make: str, model: str, diagonal: float) -> None:
    assert sensor_diagonal(make, model) == diagonal
    assert sensor_diagonal(make.upper(), model.lower()) == diagonal


# Nikon's full-frame and DX bodies share the beginnings of their names
@pytest.mark.parametrize("model", "D3 D3S D3X D4 D4S D5 D6 D600 D610 D700 D750 D780 D800 D800E D810 D850 Df".split())
def test_nikons_full_frame_bodies(model: str) -> None:
    assert sensor_diagonal("NIKON CORPORATION", f"NIKON {model}") == FULL_FRAME


@pytest.mark.parametrize(
    "model",
    "D40 D40X D50 D60 D70 D80 D90 D200 D300 D300S D500 D3000 D3100 D3200 D3300 D3400 D3500 D5000 D5300 D5600 D7000 "
    "D7100 D7200 D7500".split(),
)
def test_nikons_dx_bodies(model: str) -> None:
    assert sensor_diagonal("NIKON CORPORATION", f"NIKON {model}") == APS_C


@pytest.mark.parametrize("make, model", [(None, None), ("", ""), ("Apple", "iPhone 15 Pro"), ("Scan", "Scanner 3"),
                                         ("Canon", None), (None, "Camera"), ("SONY", "DSC-RX1RM2")])  # fmt: skip
def test_what_the_table_does_not_know_is_none(make: str | None, model: str | None) -> None:
    assert sensor_diagonal(make, model) is None


def test_a_missing_make_is_no_obstacle() -> None:
    assert sensor_diagonal(None, "Canon EOS 5D") == FULL_FRAME
    assert sensor_diagonal("Canon EOS 5D", None) == FULL_FRAME
