"""Which pairs of pictures are worth matching, and which matches agree with some motion of the camera."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import poselib
from numpy.typing import NDArray

from ...cameras.rig import PictureMatches
from ...pose.features import Features
from ...raster.arrays import Array
from .averaged import Verified, first_is
from .options import PAIRS


def chosen_pairs(
    features: Sequence[Features], most_all: int = PAIRS.most_all, most_each: int = PAIRS.most_each
) -> list[tuple[int, int]]:
    """Choose pairs (i, j), i < j, to match: all of them, or in large sets each picture with those most like it.

    Parameters
    ----------
    features : sequence of Features
        Of every picture.
    most_all : int
        Pictures up to which all pairs are chosen.
    most_each : int
        Pictures that each one is paired with beyond that, at least; the others may choose it too.

    Returns
    -------
    list of (int, int)
        In ascending order.
    """
    count = len(features)
    if count <= most_all:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    likeness = _likeness(features)
    np.fill_diagonal(likeness, -np.inf)
    nearest = np.argsort(-likeness, axis=1, kind="stable")[:, :most_each]
    return sorted({(min(i, int(j)), max(i, int(j))) for i in range(count) for j in nearest[i]})


def _likeness(features: Sequence[Features]) -> Array:
    """How alike pictures are (N, N): products of their vectors of locally aggregated descriptors (Jégou et al.)."""
    voters = [_thinned(item.descriptors, PAIRS.descriptors) for item in features]
    words = _words(np.concatenate([_thinned(v, max(1, PAIRS.sample // len(voters))) for v in voters]))
    vectors = np.zeros((len(voters), words.size))
    for row, descriptors in zip(vectors, voters, strict=True):
        total, size = _summed(descriptors, _nearest(descriptors, words))
        off = total - words * size[:, None]
        # each word counts alike however often it occurs: repeated structure would drown the rest
        off /= np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-12)
        row[:] = off.ravel()
    vectors /= np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    likeness: Array = vectors @ vectors.T
    return likeness


def _words(descriptors: NDArray[np.float32]) -> Array:
    """Centres of the descriptors' clusters, by Lloyd's iteration from starts that no order of pictures changes."""
    ordered = descriptors[np.lexsort(descriptors.T[::-1])]
    words: Array = ordered[np.linspace(0, len(ordered) - 1, PAIRS.words).astype(int)].astype(np.float64)
    for _ in range(PAIRS.word_rounds):
        total, size = _summed(ordered, _nearest(ordered, words))
        words[size > 0] = total[size > 0] / size[size > 0, None]
    return words


def _summed(descriptors: Array | NDArray[np.float32], word: NDArray[np.intp]) -> tuple[Array, Array]:
    """Sums of the descriptors (words, 128) of each word, and how many they are."""
    of_word = np.zeros((PAIRS.words, len(word)))
    of_word[word, np.arange(len(word))] = 1
    return of_word @ descriptors, of_word.sum(axis=1)


def _nearest(descriptors: NDArray[np.float32], words: Array) -> NDArray[np.intp]:
    nearest: NDArray[np.intp] = np.argmax(descriptors @ words.T - (words**2).sum(axis=1) / 2, axis=1)
    return nearest


def _thinned(descriptors: NDArray[np.float32], most: int) -> NDArray[np.float32]:
    if len(descriptors) <= most:
        return descriptors
    few: NDArray[np.float32] = descriptors[np.linspace(0, len(descriptors) - 1, most).astype(int)]
    return few


def verified(points: Sequence[Array], matches: Iterable[PictureMatches], scale: float, seed: int) -> Verified:
    """Keep the matches of each pair that agree with one fundamental matrix, and the pairs where enough do.

    Parameters
    ----------
    points : sequence of (M_i, 2)
        The features of every picture, px, free of distortion as far as that is known.
    matches : iterable of PictureMatches
        Of each pair at most once.
    scale : float
        px by which thresholds are multiplied.
    seed : int
        Of RANSAC.

    Returns
    -------
    Verified
        In an order that does not depend on the numbers of the pictures.
    """
    best = np.zeros(len(points), np.intp)
    kept: list[tuple[tuple[float, ...], PictureMatches, int]] = []
    for pair in matches:
        ordered = _ordered(points, pair)
        inliers = _agreeing(points, ordered, scale, seed)
        count = int(inliers.sum())
        best[[pair.i, pair.j]] = np.maximum(best[[pair.i, pair.j]], count)
        if count >= PAIRS.min_inliers and count > PAIRS.chance_inliers + PAIRS.chance_share * len(pair):
            agreed = PictureMatches(pair.i, pair.j, ordered.index[inliers])
            kept.append(((-count, *_content(points, agreed)), agreed, len(pair)))
    kept.sort(key=lambda item: item[0])
    return Verified(tuple(k[1] for k in kept), tuple(k[2] for k in kept), best, scale, seed)


def _ordered(points: Sequence[Array], pair: PictureMatches) -> PictureMatches:
    """The same matches in an order that their places decide."""
    if not len(pair):
        return pair
    column = first_is(points, pair)[0]
    place = points[(pair.i, pair.j)[column]][pair.index[:, column]]
    other = points[(pair.j, pair.i)[column]][pair.index[:, 1 - column]]
    return PictureMatches(pair.i, pair.j, pair.index[np.lexsort((*other.T, *place.T))])


def _content(points: Sequence[Array], pair: PictureMatches) -> tuple[float, ...]:
    column = first_is(points, pair)[0]
    place = points[(pair.i, pair.j)[column]][pair.index[:, column]]
    return tuple(place.sum(axis=0))


def _agreeing(points: Sequence[Array], pair: PictureMatches, scale: float, seed: int) -> NDArray[np.bool_]:
    if len(pair) < PAIRS.min_inliers:
        return np.zeros(len(pair), bool)
    first, second = first_is(points, pair)
    x, y = (points[(pair.i, pair.j)[column]][pair.index[:, column]] for column in (first, second))
    options = {
        "max_epipolar_error": PAIRS.inlier_px * scale,
        "seed": seed,
        "max_iterations": PAIRS.iterations,
        "min_iterations": PAIRS.fewest_iterations,
    }
    _, info = poselib.estimate_fundamental(x, y, options, {})
    return np.asarray(info["inliers"], bool)
