"""Lens profiles of lensfun: which lens, at which focal length, on which sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.lens_models import LensProjection
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.system.errors import BadRequest

SIZE, NAMES = (900, 600), ("a.jpg", "b.jpg")
# 24 mm on full frame: f = 600 px
EXIF = Exif(focal_mm=24.0, focal35_mm=24.0, lens="EF24-105mm f/4L IS USM")
DATABASE = """<!-- made by hand -->
<lensdatabase version="1">
  <camera><maker>Canon</maker><model>Canon EOS 5D</model><mount>Canon EF</mount><cropfactor>1</cropfactor></camera>
  <lens>
    <maker>Canon</maker><model>Canon EF 24-105mm f/4L IS USM</model><mount>Canon EF</mount><cropfactor>1</cropfactor>
    <calibration>
      <distortion model="ptlens" focal="20" a="0.01" b="-0.04" c="0.02" />
      <distortion model="ptlens" focal="28" a="0.03" b="-0.02" c="0" />
      <distortion model="poly3" focal="105" k1="0.01" />
      <tca model="linear" focal="24" kr="1" kb="1" />
    </calibration>
  </lens>
  <lens>
    <maker>Canon</maker><model>Canon EF 24-105mm f/4L IS USM</model><mount>Canon EF</mount><cropfactor>1.6</cropfactor>
    <calibration><distortion model="poly5" focal="24" k1="-0.02" k2="0.005" /></calibration>
  </lens>
  <lens>
    <maker>Samyang</maker><model>Samyang 8mm f/3.5 Fish-Eye</model><mount>Canon EF</mount><cropfactor>1</cropfactor>
    <type>stereographic</type><calibration><distortion model="poly3" focal="8" k1="0.02" /></calibration>
  </lens>
  <lens><model>Broken 10mm</model><cropfactor>x</cropfactor>
    <calibration><distortion model="acm" focal="8" /></calibration>
  </lens>
</lensdatabase>
"""


def camera(folder: Path, exif: Exif = EXIF, text: str = DATABASE) -> Camera:
    """That of the first picture."""
    (folder / "lenses.xml").write_text(text)
    request = CameraRequest(cameras=folder / "lenses.xml")
    return cameras_for(request, NAMES, (SIZE, SIZE), (exif, exif))[0][0]


def test_the_lens_is_exifs_between_its_calibrations(tmp_path: Path) -> None:
    found = camera(tmp_path, Exif(focal_mm=22.0, focal35_mm=22.0, lens=EXIF.lens))
    assert found.lens is not None and np.allclose(found.lens.ptlens, (0.015, -0.035, 0.015))
    found = camera(tmp_path)
    assert found.lens is not None and np.allclose(found.lens.ptlens, (0.02, -0.03, 0.01))
    # half the shorter side of full frame is 12 mm: half of 24 mm
    assert abs(found.lens.radius - 0.5) < 1e-12
    assert abs(found.focal - 600) < 1e-9 and not found.fixed and found.lens_known
    assert "EF 24-105mm" in found.source and "EXIF" in found.source


def test_beyond_its_calibrations_the_nearest_counts(tmp_path: Path) -> None:
    for focal, abc in ((18.0, (0.01, -0.04, 0.02)), (35.0, (0.03, -0.02, 0)), (100.0, (0, 0.01, 0))):
        found = camera(tmp_path, Exif(focal_mm=focal, focal35_mm=focal, lens=EXIF.lens))
        assert found.lens is not None and np.allclose(found.lens.ptlens, abc)


def test_on_a_smaller_sensor_its_own_calibration_counts(tmp_path: Path) -> None:
    found = camera(tmp_path, Exif(focal_mm=24.0, focal35_mm=38.4, lens=EXIF.lens))
    assert found.lens is None and abs(found.focal - 960) < 1e-9
    # at half the shorter side, 300 px, its radius is 1 − 0.02 + 0.005
    middle = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])
    assert np.allclose(distort(middle + (0, 300), found) - middle, (0, 300 * 0.985))


def test_a_crop_of_full_frame_takes_the_calibration_of_full_frame(tmp_path: Path) -> None:
    """On a sensor 1.3 times smaller the unit, 12 mm, lies beyond the picture's border."""
    found = camera(tmp_path, Exif(focal_mm=24.0, focal35_mm=31.2, lens=EXIF.lens))
    assert found.lens is not None and abs(found.lens.radius * found.focal - 300 * 1.3) < 1e-9


def test_a_fisheye_is_of_its_type_and_held(tmp_path: Path) -> None:
    found = camera(tmp_path, Exif(focal_mm=8.0, focal35_mm=8.0, lens="Samyang 8mm f/3.5 Fish-Eye CS"))
    assert found.lens is not None and found.lens.projection == LensProjection.STEREOGRAPHIC and found.fixed


def test_one_lens_alone_is_taken_whatever_exif_calls_it(tmp_path: Path) -> None:
    alone = DATABASE[: DATABASE.index("  <lens>\n    <maker>Samyang")] + "</lensdatabase>"
    assert camera(tmp_path, Exif(focal_mm=24.0, focal35_mm=24.0), alone).lens is not None


def test_without_a_focal_length_in_px_its_polynomial_is_of_the_same_sensor(tmp_path: Path) -> None:
    found = camera(tmp_path, Exif(focal_mm=24.0, lens=EXIF.lens))
    assert found.assumed and found.lens is not None and abs(found.lens.radius * found.focal - 300) < 1e-9


@pytest.mark.parametrize(("exif", "old", "new", "said"), [
    (Exif(lens=EXIF.lens), "", "", "a.jpg: its EXIF tells no focal length in mm"),
    (Exif(focal_mm=24.0), "", "", r"the lens of a.jpg \(not named by EXIF\) may be none of those in it, Broken 10mm"),
    (Exif(focal_mm=24.0, lens="mm"), "", "", "may be several of those in it, Broken 10mm"),
    (Exif(focal_mm=24.0, lens="Broken 10mm"), "", "", "the distortion 'acm' is not read; ptlens, poly3, poly5"),
    (Exif(focal_mm=24.0, lens="Broken 10mm"), '"acm"', '"poly3"', "the crop factor is 'x'"),
    (EXIF, 'a="0.01"', 'a="big"', "lens 'Canon EF 24-105mm .*: a is 'big'"),
    (EXIF, 'focal="20"', 'focal="-20"', "must be above 0"), (EXIF, "</lens>", "", "not sound XML"),
    (EXIF, "<distortion", "<tca", "no lens with calibrated distortion"),
    (Exif(focal_mm=8.0, lens="Samyang 8mm"), "<type>stereographic", "<type>panoramic", "'panoramic' is not read"),
])  # fmt: skip
def test_what_does_not_fit_is_refused(exif: Exif, old: str, new: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=said):
        camera(tmp_path, exif, DATABASE.replace(old, new) if old else DATABASE)
