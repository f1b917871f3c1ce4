"""What any program has left of a pair or set: layers, layers and masks, maps, or a panorama (docs/formats.md)."""

from __future__ import annotations

import json
import re
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...measure.placed.placed import PlacedPicture, PlacedSet, RaysAt, shrinking, shrunk, union
from ...panorama.projection import Projection
from ...pictures.containers import read_structure
from ...pictures.decoding import check_size, decode_file, read_file
from ...pictures.options import READING
from ...pictures.picture import Picture
from ...raster.picture_map import PictureMap
from ...raster.sampling import fetch
from ...system.errors import BadRequest, UnreadableImage
from ..pairs import PairFiles

CANVAS, WARP = "canvas.json", "warp.npz"
_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg")
_LAYER = re.compile(r"(\d+)_(?!mask$).+")
# Alpha from which a px of a layer counts as shown, of 255: less is the rim.
_SHOWN = 250
# px outside a picture beyond which a map need not say how far: what is larger overflows.
_FARTHEST = 1e9
# What reading a damaged file raises.
_DAMAGED = (OSError, ValueError, KeyError, IndexError, TypeError, RecursionError)


def outside_of(
    outside: Sequence[tuple[str, Path]], pair: PairFiles, count: int
) -> dict[str, Callable[[Sequence[Picture]], PlacedSet]]:
    """How the results of other programs for a pair or set are read, by their names: in a folder of its name, or where
    only one is compared in the folder itself."""
    found: dict[str, Callable[[Sequence[Picture]], PlacedSet]] = {}
    for name, folder in outside:
        own = folder / pair.name
        place = folder if count == 1 and not own.is_dir() else own
        found[name] = lambda pictures, place=place: read_folder(place, pictures)  # type: ignore[misc]
    return found


def read_folder(folder: Path, pictures: Sequence[Picture]) -> PlacedSet:
    """A program's result for some pictures.

    Parameters
    ----------
    folder : Path
        Holds NN_NAME.png of each picture that is used, NN its number from 00 in the order of the names, all as large as
        the canvas: with alpha, or with NN_mask.png, white where it shows. Or warp.npz with maps, as `edf stitch --warp`
        writes it, or both. canvas.json, as `edf stitch --layers` writes it, says what surface it is; panorama.png, with
        alpha, what is finally shown.
    pictures : sequence of Picture
        That were stitched.

    Returns
    -------
    PlacedSet

    Raises
    ------
    UnreadableImage
        There is no such folder, or a file cannot be read.
    BadRequest
        What is in it does not fit together.
    """
    if not folder.is_dir():
        raise UnreadableImage(f"{folder}: there is no such folder; results for a pair lie in a folder of its name")
    projection = _projection(folder)
    focal = float("nan") if projection is None else projection.focal
    files: dict[int, Path] = {}
    for path in _images(folder):
        if found := _LAYER.fullmatch(path.stem):
            if int(found[1]) in files:
                raise BadRequest(f"{path}: {files[int(found[1])].name} has the same number; each picture has one layer")
            files[int(found[1])] = path
    maps = _maps(folder / WARP, len(pictures))
    numbers = sorted({*files, *maps})
    if not numbers:
        raise BadRequest(f"{folder} holds neither layers (00_NAME.png, 01_NAME.png, …) nor {WARP}")
    if numbers[-1] >= len(pictures):
        raise BadRequest(f"{folder}: a layer has the number {numbers[-1]:02d}, and there are {len(pictures)} pictures")
    placed: list[PlacedPicture] = []
    whole = size = None
    for number in numbers:
        colours, shows = _layer(folder, files[number]) if number in files else _fetched(pictures[number], maps[number])
        whole = whole or (shows.shape[1], shows.shape[0])
        if shows.shape != whole[::-1] or (number in maps and maps[number].shape != shows.shape):
            raise BadRequest(f"{folder}: layers and maps differ in size; all are as large as the canvas")
        size = (max(1, round(whole[0] * shrinking(focal))), max(1, round(whole[1] * shrinking(focal))))
        parts = shrunk(colours, shows, maps.get(number), size)
        placed.append(PlacedPicture.cut_out(pictures[number].name, *parts))
    assert whole is not None and size is not None
    shown = union(size, placed)
    panorama = folder / "panorama.png"
    if panorama.is_file():
        _, alpha = _layer(folder, panorama, np.ones(whole[::-1], bool))
        if alpha.shape != whole[::-1]:
            raise BadRequest(f"{panorama}: it is not as large as the layers")
        shown = shrunk(np.zeros((*alpha.shape, 3), np.uint8), alpha, None, size)[1]
    rays_at = None if projection is None else _rays(projection, whole[0] / size[0], whole[1] / size[1])
    return PlacedSet(size, tuple(placed), rays_at, shown, focal * shrinking(focal))


def _images(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in _SUFFIXES)


def _layer(
    folder: Path, path: Path, shows: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """R, G, B of a layer, and where it shows something: by its alpha, by a mask beside it, or as given."""
    image = _levels(path)
    colours = image[..., :1] if image.shape[2] < 3 else image[..., :3]
    colours = np.repeat(colours, 3, axis=2) if colours.shape[2] == 1 else np.ascontiguousarray(colours)
    if image.shape[2] in (2, 4):
        return colours, image[..., -1] >= _SHOWN
    masks = [one for one in _images(folder) if one.stem == f"{path.stem.partition('_')[0]}_mask"]
    if masks:
        mask = _levels(masks[0])
        if mask.shape[:2] != colours.shape[:2]:
            raise BadRequest(f"{masks[0]}: a mask is a gray picture as large as its layer")
        return colours, mask[..., :3].min(axis=2) >= _SHOWN
    if shows is None:
        mask_name = f"{path.stem.partition('_')[0]}_mask.png"
        raise BadRequest(
            f"{path}: it has no alpha, and there is no {mask_name} beside it, white where it shows the picture; black "
            "is not taken for nothing"
        )
    return colours, shows


def _levels(path: Path) -> NDArray[np.uint8]:
    """Levels (H, W, 1 to 4) of a file, in R, G, B, A order, which is checked before it is decoded as any picture is."""
    try:
        data = read_file(path)
        structure = read_structure(data)
        if structure is None or structure.kind not in ("png", "tiff", "jpeg"):
            raise UnreadableImage("cannot be read as a picture; layers and masks are PNG, TIFF or JPEG")
        if structure.damage:
            raise UnreadableImage(f"the file is damaged: {structure.damage}; write it again")
        check_size(structure.width, structure.height, len(data), READING.drawing_pixels_per_byte)
        raw = decode_file(data, structure).raw
    except UnreadableImage as error:
        raise UnreadableImage(f"{path}: {error}") from error
    levels = np.rint(raw / 257).astype(np.uint8) if raw.dtype == np.uint16 else raw
    if levels.dtype != np.uint8:
        raise BadRequest(f"{path}: layers have 8 or 16 bits")
    return levels


def _maps(path: Path, count: int) -> dict[int, PictureMap]:
    """Maps of the whole canvas by the numbers of their pictures, of a file as --warp writes it."""
    if not path.is_file():
        return {}
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            width, height = (int(side) for side in content["canvas"])
            if not 0 < width * height <= READING.max_pixels:
                raise ValueError(f"a canvas of {width} × {height} pixels")
            sizes = content["sizes"]
            found = {}
            for number in range(min(count, len(sizes))):
                if f"map_x_{number:02d}" not in content:
                    if number == 0 and np.isfinite(content["offset"]).all():
                        found[0] = _pasted(content["offset"], (width, height), (int(sizes[0][0]), int(sizes[0][1])))
                    continue
                left, top, across, down = (int(side) for side in content[f"box_{number:02d}"])
                x, y = (np.full((height, width), np.nan, np.float32) for _ in "xy")
                for whole, axis in ((x, "x"), (y, "y")):
                    part = content[f"map_{axis}_{number:02d}"]
                    whole[top : top + down, left : left + across] = np.clip(part, -_FARTHEST, _FARTHEST)
                found[number] = PictureMap(x, y, (int(sizes[number][0]), int(sizes[number][1])))
    except (*_DAMAGED, zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise BadRequest(f"{path}: not a file of maps ({error}); docs/formats.md says what is in one") from error
    return found


def _pasted(offset: NDArray[Any], canvas: tuple[int, int], size: tuple[int, int]) -> PictureMap:
    """The map of a picture that lies on its own plane, its first pixel at `offset` of the canvas."""
    y, x = np.mgrid[: canvas[1], : canvas[0]].astype(np.float32)
    left, top = np.clip(offset, -_FARTHEST, _FARTHEST).astype(np.float32)
    return PictureMap(x - left, y - top, size)


def _fetched(picture: Picture, found: PictureMap) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """What a map shows of a picture of its size."""
    if picture.view.shape[1::-1] != found.size:
        raise BadRequest(f"{picture.name}: the map is of a picture of {found.size[0]}×{found.size[1]} px")
    inside = found.inside()
    x, y = (np.where(inside, values, -1).astype(np.float32) for values in (found.x, found.y))
    colours = fetch(picture.view, x, y, cv2.INTER_LINEAR)
    return (np.repeat(colours, 3, axis=2) if colours.shape[2] == 1 else colours), inside


def _projection(folder: Path) -> Projection | None:
    """What surface the canvas is, where canvas.json says it."""
    path = folder / CANVAS
    if not path.is_file():
        return None
    try:
        told = json.loads(path.read_text("utf-8"))["projection"]
        projection = Projection(
            str(told["kind"]), float(told["focal_px"]), (float(told["centre"][0]), float(told["centre"][1])),
            np.array(told["rotation"], np.float64).reshape(3, 3), np.eye(3), float(told.get("distance", 0.0)),
        )
    except _DAMAGED as error:
        raise BadRequest(f"{path}: not what --layers writes ({error}); leave it out if that is not known") from None
    if projection.kind not in ("perspective", "pannini", "cylindrical", "equirectangular"):
        raise BadRequest(f"{path}: the projection {projection.kind!r} is not known; leave the file out")
    turned = projection.rotation @ projection.rotation.T
    if not np.allclose(turned, np.eye(3), atol=1e-3):  # NaN too
        raise BadRequest(f"{path}: its rotation is none; leave the file out if that is not known")
    if not (0 < projection.focal < np.inf and np.isfinite(projection.centre).all() and 0 <= projection.distance <= 1):
        raise BadRequest(
            f"{path}: focal_px above 0, a finite centre and a distance from 0 to 1 are needed; leave the file out if "
            "they are not known"
        )
    return projection


def _rays(projection: Projection, across: float, down: float) -> RaysAt:
    """Rays of a shrunk canvas, so many px of the whole along one of its px."""
    step = np.array([across, down])
    return lambda at: projection.rays((at + 0.5) * step - 0.5)
