"""The pictures of the extension's page, in the sizes that Blender's platform takes: `make listing`.

    listing_pictures.py -o DIR

icon.png, 256 × 256, is drawn here; featured.jpg and previews, 1920 × 1080, are pictures of docs/, enlarged and on a
dark ground: none is cut.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

DOCS = Path(__file__).resolve().parent.parent / "docs"
ICON = 256  # px
PAGE = (1920, 1080)  # px
GROUND = (36, 32, 30)  # BGR, as dark as Blender's window
FEATURED = "room"
PREVIEWS = ("blender", "blender_more", "projections", "plate", "sphere")
# Share of white in the icon's overlap; px of the icon's corners, and how many times finer it is drawn.
LIGHTER, CORNER, FINER = 0.25, 40, 4


def icon() -> np.ndarray:
    """Two pictures that stand at an angle, and the post that both show, whole: (256, 256, 4) BGRA."""
    side, unit = ICON * FINER, FINER
    ground, alpha = np.zeros((side, side, 3), np.uint8), np.zeros((side, side), np.uint8)
    ground[:] = GROUND
    corner = CORNER * unit
    cv2.rectangle(alpha, (corner, 0), (side - corner, side), 255, -1)
    cv2.rectangle(alpha, (0, corner), (side, side - corner), 255, -1)
    for x in (corner, side - corner):
        for y in (corner, side - corner):
            cv2.circle(alpha, (x, y), corner, 255, -1, cv2.LINE_AA)
    frames = [_filled(side, corners) for corners in (
        ((28, 74), (152, 92), (152, 164), (28, 182)), ((228, 74), (104, 92), (104, 164), (228, 182)))]  # fmt: skip
    for frame, colour in zip(frames, ((205, 140, 60), (60, 130, 230)), strict=True):
        ground = np.where(frame[..., None], np.array(colour, np.uint8), ground)
    both = (frames[0] & frames[1])[..., None]
    mixed = np.array((205 + 60, 140 + 130, 60 + 230)) / 2 * (1 - LIGHTER) + 255 * LIGHTER
    ground = np.where(both, mixed.astype(np.uint8), ground)
    post = _filled(side, ((121, 46), (135, 46), (135, 210), (121, 210)))
    ground = np.where(post[..., None], np.array((245, 245, 245), np.uint8), ground)
    return cv2.resize(np.dstack([ground, alpha]), (ICON, ICON), interpolation=cv2.INTER_AREA)


def _filled(side: int, corners: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Where (side, side) a polygon is, its corners in px of the icon."""
    mask = np.zeros((side, side), np.uint8)
    cv2.fillPoly(mask, [np.array(corners, np.int32) * FINER], 1)
    return mask > 0


def on_a_page(picture: np.ndarray) -> np.ndarray:
    """A picture as large as the page has room for, in its middle."""
    width, height = PAGE
    times = min(width / picture.shape[1], height / picture.shape[0])
    large = cv2.resize(picture, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)[:height, :width]
    page = np.empty((height, width, 3), np.uint8)
    page[:] = GROUND
    top, left = (height - large.shape[0]) // 2, (width - large.shape[1]) // 2
    page[top : top + large.shape[0], left : left + large.shape[1]] = large
    return page


def write_all(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "icon.png").write_bytes(cv2.imencode(".png", icon())[1].tobytes())
    named = [(FEATURED, "featured"), *((name, f"preview_{name}") for name in PREVIEWS)]
    for source, name in named:
        picture = cv2.imread(str(DOCS / f"{source}.jpg"))
        if picture is None:
            raise SystemExit(f"{DOCS / source}.jpg cannot be read")
        data = cv2.imencode(".jpg", on_a_page(picture), [cv2.IMWRITE_JPEG_QUALITY, 92])[1]
        (folder / f"{name}.jpg").write_bytes(data.tobytes())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="The pictures of the extension's page.")
    parser.add_argument("-o", "--output-dir", type=Path, required=True)
    write_all(parser.parse_args().output_dir)
