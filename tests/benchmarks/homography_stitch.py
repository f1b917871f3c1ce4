"""The plainest stitcher, as a yardstick for `bench.py`: EDF Stitch's own features, one homography, 8-bit feathering.

    homography_stitch.py [--opencv-stitcher] REF TARGET OUT
    homography_stitch.py --floor REF TARGET PANORAMA OUT     nothing but decode, remap, and encode of as many pixels
"""

import sys

import cv2
import numpy as np


def main(reference: str, target: str, out: str) -> None:
    """Stitch two files with one homography."""
    from edf_stitch.core.pose.features import detect, match

    a, b = cv2.imread(reference), cv2.imread(target)
    matches = match(detect(a[..., ::-1].copy()), detect(b[..., ::-1].copy()))
    cv2.setRNGSeed(0)
    H, _ = cv2.findHomography(matches.y, matches.x, cv2.USAC_MAGSAC, 3.0, maxIters=10000, confidence=0.999)
    height, width = b.shape[:2]
    corners = np.float64([[0, 0], [width, 0], [width, height], [0, height]])
    there = cv2.perspectiveTransform(corners[None], H)[0]
    low = np.floor(np.minimum(there.min(axis=0), 0)).astype(int)
    high = np.ceil(np.maximum(there.max(axis=0), a.shape[1::-1])).astype(int)
    size = tuple(int(v) for v in np.minimum(high - low, 4 * max(a.shape)))
    shift = np.array([[1, 0, -low[0]], [0, 1, -low[1]], [0, 0, 1.0]])
    layers, weights = [], []
    for picture, move in ((a, shift), (b, shift @ H)):
        layers.append(cv2.warpPerspective(picture, move, size, flags=cv2.INTER_CUBIC))
        mask = cv2.warpPerspective(np.full(picture.shape[:2], 255, np.uint8), move, size, flags=cv2.INTER_NEAREST)
        weights.append(cv2.distanceTransform(np.pad(mask, 1), cv2.DIST_L2, 5)[1:-1, 1:-1])
    share = weights[0] / np.maximum(weights[0] + weights[1], 1e-6)
    cv2.imwrite(out, cv2.blendLinear(layers[0], layers[1], share, 1 - share))


def stitcher(reference: str, target: str, out: str) -> None:
    """Stitch two files with OpenCV's high-level Stitcher."""
    status, panorama = cv2.Stitcher_create(cv2.Stitcher_PANORAMA).stitch([cv2.imread(reference), cv2.imread(target)])
    if status != cv2.Stitcher_OK:
        sys.exit(1)
    cv2.imwrite(out, panorama)


def floor(reference: str, target: str, panorama: str, out: str) -> None:
    """Read two files, remap one onto a canvas of the panorama's size, write it."""
    from edf_stitch.core.pictures.containers import read_structure

    cv2.imread(reference)
    picture = cv2.imread(target)
    with open(panorama, "rb") as file:
        size = read_structure(file.read())
    height, width = picture.shape[:2]
    x = np.linspace(0, width - 1, size.width, dtype=np.float32)[None].repeat(size.height, axis=0)
    y = np.linspace(0, height - 1, size.height, dtype=np.float32)[:, None].repeat(size.width, axis=1)
    cv2.imwrite(out, cv2.remap(picture, x, y, cv2.INTER_CUBIC))


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments[0] == "--floor":
        floor(*arguments[1:])
    elif arguments[0] == "--opencv-stitcher":
        stitcher(*arguments[1:])
    else:
        main(*arguments)
