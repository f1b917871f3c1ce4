"""What the tests of several rooms share: a rendered pair, its files, finished stitches, geometry by hand, photographs.

Everything of session scope is shared: read it, never write to it.
"""

from __future__ import annotations

# ruff: noqa: E402, I001
import os

# Before NumPy loads, as the command does it: with several threads BLAS may give other last bits from call to call.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.field.field import FieldValues
from edf_stitch.core.cameras.projective import fundamental_from_pose, infinite_homography, rotation_from_vector
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.synthetic_scenes.two_planes import Pair, make_pair
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

from .pairs import ON_REFERENCE

# The same examples on every machine, and no verdict by the clock: a busy one is slow, not wrong.
settings.register_profile(
    "edf", derandomize=True, deadline=None, database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)  # fmt: skip
settings.load_profile("edf")
# Hypothesis also tries numbers that it finds in our sources, as far as they are loaded: then the examples would depend
# on which tests ran before, and on every constant that somebody tunes.
providers.is_local_module_file = lambda _path: False

# No test finds what another has left, and none leaves anything at home: no folder can be made there.
os.environ["EDF_CACHE"] = os.devnull


@pytest.fixture(scope="session")
def pair() -> Pair:
    """Rendered with known cameras, 400 × 300."""
    return make_pair(400, 300)


@pytest.fixture(scope="session")
def small_pair() -> Pair:
    """As small as a pair can be and still give some 200 matches: half a second a stitch."""
    return make_pair(240, 180)


def true_focal(pair: Pair) -> StitchOptions:
    return replace(ON_REFERENCE, camera=CameraRequest(focal_px=(pair.reference_camera.K[0, 0],)))


@pytest.fixture(scope="session")
def known(small_pair: Pair) -> StitchOptions:
    """Options that give the small pair's true focal length."""
    return true_focal(small_pair)


@pytest.fixture(scope="session")
def result(pair: Pair) -> StitchResult:
    """The 400 × 300 pair, stitched from arrays with its true focal length."""
    return stitch((pair.reference, pair.target), true_focal(pair))


@pytest.fixture(scope="session")
def small_result(small_pair: Pair, known: StitchOptions) -> StitchResult:
    """The small pair, stitched from arrays with its true focal length."""
    return stitch((small_pair.reference, small_pair.target), known)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, small_pair: Pair) -> Path:
    """A folder with reference.png and target.png of the small pair. Nothing is to be written there."""
    out = tmp_path_factory.mktemp("pair")
    for name, array in (("reference", small_pair.reference), ("target", small_pair.target)):
        (out / f"{name}.png").write_bytes(encode_picture(picture_from_array(array).pixels, None, 8, ".png")[0])
    return out


@pytest.fixture(scope="session")
def found_before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache for tests of what comes after features and geometry: only the first of them looks for these."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def with_cache(found_before: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stitches from here on, of other processes too, use that cache."""
    monkeypatch.setenv("EDF_CACHE", str(found_before))


@dataclass(frozen=True)
class GivenField:
    """A displacement field that is a function of reference pixels (…, 2)."""

    depth: Callable[[np.ndarray], np.ndarray]
    plane: np.ndarray
    name: str = "given"

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        return FieldValues(self.depth(grid.points if ideal is None else ideal))


def camera_of(size: tuple[int, int], focal: float, distortion: tuple[float, ...] = ()) -> Camera:
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    return Camera(K, size, "test", 0.0, np.array([*distortion, *[0.0] * (5 - len(distortion))]))


def view_of(camera: Camera, camera_prime: Camera, turn: tuple[float, ...], t: tuple[float, ...]) -> TwoView:
    """turn: rotation vector in degrees; t: direction of the baseline in the target camera's frame."""
    K, K_prime, R = camera.K, camera_prime.K, rotation_from_vector(np.radians(turn))
    t_unit = np.array(t) / np.linalg.norm(t)
    return TwoView(
        K, K_prime, R, t_unit, fundamental_from_pose(K, K_prime, R, t_unit), infinite_homography(K, K_prime, R),
        K_prime @ t_unit, np.ones(0, bool), 0.1, "general", "by hand", "test", 0.0, 0.0,
    )  # fmt: skip


def plane_field(*plane: float) -> GivenField:
    """The field of a plane m: d = m·(x, y, 1)."""
    m = np.array(plane)
    return GivenField(lambda points: points @ m[:2] + m[2], m)


@pytest.fixture(scope="session")
def by_hand() -> SimpleNamespace:
    """Cameras, two-view geometry and displacement fields without any estimation: camera, view, plane_field, Field."""
    return SimpleNamespace(camera=camera_of, view=view_of, plane_field=plane_field, Field=GivenField)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real photographs: EDF_DATA, or ../shared/data beside the checkout."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    found = Path(os.environ.get("EDF_DATA") or beside)
    if not found.is_dir():
        pytest.skip(f"no photographs in {found}; EDF_DATA names the folder")
    return found
