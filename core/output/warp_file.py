"""The file of a warp: geometry and maps, from which each layer can be made again."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.lens_entries import lens_entry
from ..panorama.rig_viewpoint import RigViewpoint
from ..raster.lazy import whole
from ..raster.picture_map import BoxedMap, MapPart

if TYPE_CHECKING:
    from ..pipeline import StitchResult

# Version of the file (docs/formats.md).
WARP_FORMAT = 2


def write_warp(result: StitchResult, file: IO[bytes]) -> None:
    """Writes the warp's file: geometry and maps, from which each layer can be made again.

    Canvas pixel p + offset is seen at x ~ H_inf p + inverse_depth e_prime. On other surfaces p = K r for the unit
    ray r of the pixel instead; there is no offset, but `projection` (its name), `focal` (px per radian), `centre`
    (canvas px of the direction ahead) and `rotation` (from its axes to the reference camera's). Where the viewpoint
    slides, by `slide` s, which is `s1` at most, that ray starts at s c, c = −Rᵀ t of the target, and inverse_depth is
    measured from there: x ~ K (R (r + inverse_depth s c) + inverse_depth t). Of more than two pictures `places` say
    where it starts. docs/formats.md lists every key.

    Parameters
    ----------
    result : StitchResult
    file : binary file
        Becomes an .npz file; NaN stands for what a model does not know. The same result gives the same bytes.
    """
    write_npz(file, _warp_arrays(result))


def warp_bytes(result: StitchResult) -> bytes:
    """The same as bytes."""
    buffer = io.BytesIO()
    write_warp(result, buffer)
    return buffer.getvalue()


def _warp_arrays(result: StitchResult) -> Iterator[tuple[str, NDArray[Any]]]:
    """Names and arrays of the warp's file, each made when it is its turn: those of all pictures may be more than
    fits."""
    views, place, canvas = result.views, result.spread, result.canvas
    warp = result.warp if result.times > 1 else result.warp.within(place)
    e_prime, projection = np.stack([view.e_prime for view in views]), canvas.projection
    inverse_depth = whole(result.in_full(result.warp.depth, np.nan))
    if not np.isfinite(inverse_depth).any():
        # inside, e' is 0 without depth; in a file that would say that all cameras stand in one place
        e_prime[1:] = np.nan
    yield from {
        "format": np.array(WARP_FORMAT), "sizes": np.array([view.size for view in views]),
        "canvas": np.array([canvas.width, canvas.height]),
        "offset": np.array(canvas.offset, np.int64) if projection is None else np.full(2, np.nan),
        "inverse_depth": inverse_depth,
        "K": np.stack([view.K for view in views]), "R": np.stack([view.R for view in views]),
        "t": np.stack([view.t for view in views]), "dist": np.stack([view.camera.distortion for view in views]),
        "H_inf": np.stack([view.H_inf for view in views]), "e_prime": e_prime,
        "F": np.stack([edge.two_view.F for edge in result.edges]),
        "edges": np.array([(edge.i, edge.j) for edge in result.edges]),
    }.items()  # fmt: skip
    if any(view.camera.lens for view in views):
        yield "lenses", np.array([json.dumps(lens_entry(replace(view.camera, K=view.K))) for view in views])
    del inverse_depth
    for number in range(len(views)):
        if number or projection is not None:  # in a flat panorama the reference is only shifted, by `offset`
            one = result.full_map(number).within(place)
            known = one.known() if isinstance(one, BoxedMap) else MapPart(one.arrays(), (0, 0))
            yield f"map_x_{number:02d}", known.inner.x
            yield f"map_y_{number:02d}", known.inner.y
            yield f"box_{number:02d}", np.array(known.box)
    if projection is not None:
        yield from {
            "projection": np.array(projection.kind), "focal": np.array(projection.focal),
            "distance": np.array(projection.distance),
            "centre": np.array(projection.centre) + canvas.offset, "rotation": projection.rotation,
        }.items()  # fmt: skip
    if warp.slide is not None and warp.viewpoint is not None:
        yield from {"slide": whole(warp.slide), "s1": np.array(warp.viewpoint.s1)}.items()
    elif isinstance(warp.viewpoint, RigViewpoint):
        places = warp.viewpoint.s1 * warp.viewpoint.places
        s1 = np.array(warp.viewpoint.s1)
        yield from {"s1": s1, "places": places, "upright": warp.viewpoint.rotation}.items()


def write_npz(file: IO[bytes], arrays: Iterable[tuple[str, NDArray[Any]]]) -> None:
    """Writes an .npz file of named arrays: the same ones give the same bytes, while numpy.savez stores the time of day.
    """
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for name, array in arrays:
            with archive.open(zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), "w", force_zip64=True) as member:
                np.save(member, np.asarray(array, order="C"), allow_pickle=False)
