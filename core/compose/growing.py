"""The panorama so far, to which pictures are added."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ..options import StitchOptions
from ..panorama.layers import Layer
from ..raster.arrays import shown_only
from ..raster.lazy import part_of, whole
from ..system.progress import ReportProgress
from .adding import Added, add
from .decided import Decided
from .inpaint import closed_holes
from .multiband import bands_for
from .options import BANDS, PLACING, WINDOW
from .placing import Placing
from .seams.min_cut import FIRST, SECOND
from .window import Window, goes_round

if TYPE_CHECKING:
    from ..panorama.warp import Warp


class Panorama:
    """Of a pair: the second picture is added on the whole canvas, and all is worked out where it is read."""

    def __init__(
        self, warp: Warp, layers: Sequence[Layer], options: StitchOptions, wanted: NDArray[np.int16] | None = None
    ) -> None:
        self._wanted = wanted
        self._warp, self._layers, self._options = warp, layers, options
        self._open: list[NDArray[np.bool_]] = []
        self._first = 0

    def begin(self, number: int, found: Decided) -> None:
        """Start with a picture."""
        self.layer, self._first = self._layers[number], number

    def add(
        self, number: int, found: Decided, fetched: list[Layer], painted: NDArray[np.int8] | None,
        taken_over: tuple[bool, bool], progress: ReportProgress,
    ) -> Decided:  # fmt: skip
        """Add a picture.

        Parameters
        ----------
        number : int
        found : Decided
            What was decided about it.
        fetched : list of Layer
            See `Added`.
        painted : (H, W) int8 array or None
        taken_over : (bool, bool)
            Whether its seam was decided too, and whether what it is cut by is to be kept.
        progress : callable

        Returns
        -------
        Decided
            With its seam.
        """
        warp, count = self._warp, None
        if self._options.blend == "linear":
            count = (self.layer.alpha > 0).astype(np.int16)
        window = Window.whole(warp.canvas)
        added = Added(
            self._layers[number], fetched, warp.maps[number].arrays(), window, warp.canvas, found.hidden,
            found.hidden_by_depth, warp.behind, warp.lazy_confidence, warp.slide,
            _with_wanted(painted, self._wanted, number, np.int16(self._first)), None, count, self._options,
        )  # fmt: skip
        step = add(self.layer, added, found, *taken_over, progress)
        self.layer = step.panorama
        self._open.append(step.open)
        return step.decided

    def labels(self, decided: Sequence[Decided]) -> NDArray[np.int16] | None:
        """Which picture (H, W) each pixel comes from, −1 where none shows it; None without a seam."""
        chosen = decided[1].chosen
        if chosen is None:
            return None
        shown = (self._layers[self._first].alpha > 0) & (self.layer.alpha > 0)
        labels = np.where(shown, np.int16(self._first), np.int16(-1))
        labels[chosen] = 1
        return labels

    def open_holes(self) -> NDArray[np.bool_]:
        """Holes (H, W) that are to be inpainted."""
        holes = [one for one in self._open if one.size]
        nothing = np.broadcast_to(np.False_, self.layer.alpha.shape)
        return np.logical_or.reduce(holes) & (self.layer.alpha == 0) if holes else nothing


class SetPanorama(Panorama):
    """Of a larger set: each picture is added in a window of the canvas, and the panorama is held."""

    def __init__(
        self, warp: Warp, layers: Sequence[Layer], options: StitchOptions, placing: Placing,
        windows: Sequence[Window | None], wanted: NDArray[np.int16] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(warp, layers, options, wanted)
        shape = layers[0].alpha.shape
        kind = np.result_type(*(one.alpha.dtype for one in layers))
        self._light = np.zeros(layers[0].light.shape, np.float32)
        self._alpha = np.zeros(shape, kind)
        self._labels = np.full(shape, -1, np.int16)
        self._count = np.zeros(shape if options.blend == "linear" else (0, 0), np.int16)
        self._placing, self._windows = placing, windows
        self.layer = Layer(self._light, self._alpha)

    def begin(self, number: int, found: Decided) -> None:
        """Start with a picture, without what it cannot see and others show."""
        self._first = number
        window = self._window(number)
        layer = window.layer(self._layers[number])
        alpha = np.where(window.plane(found.hidden), self._alpha.dtype.type(0), layer.alpha)
        window.put(shown_only(whole(layer.light), alpha > 0), self._light)
        window.put(alpha, self._alpha)
        self._mark(number, window, alpha > 0)

    def add(
        self, number: int, found: Decided, fetched: list[Layer], painted: NDArray[np.int8] | None,
        taken_over: tuple[bool, bool], progress: ReportProgress,
    ) -> Decided:  # fmt: skip
        """See `Panorama.add`."""
        window = self._window(number)
        warp, layer = self._warp, window.layer(self._layers[number])
        confidence = None if warp.lazy_confidence is None else window.image(warp.lazy_confidence)
        count = window.plane(self._count) if self._count.size else None
        added = Added(
            layer, [], window.map(warp.maps[number]), window, warp.canvas, window.plane(found.hidden),
            window.plane(found.hidden_by_depth), None, confidence, None, self._painted(number, window, painted),
            None if warp.deviation is None else self._misplaced(number, window), count, self._options,
        )  # fmt: skip
        before = Layer(window.plane(self._light), window.plane(self._alpha))
        step = add(before, added, found, *taken_over, progress)
        light, alpha = part_of(step.panorama.light, (slice(None), slice(None))), step.panorama.alpha
        window.put(light, self._light)
        window.put(alpha, self._alpha)
        self._mark(number, window, step.decided.chosen if count is None else layer.alpha > 0)
        return step.decided

    def labels(self, decided: Sequence[Decided]) -> NDArray[np.int16] | None:
        """See `Panorama.labels`."""
        return self._labels if self._options.has_seam else None

    def open_holes(self) -> NDArray[np.bool_]:
        """Holes (H, W) that are to be inpainted: those that no picture shows, and the panorama is closed around."""
        if self._options.holes != "inpaint":
            return np.broadcast_to(np.False_, self._alpha.shape)
        return closed_holes(self._alpha > 0, None, goes_round(self._warp.canvas))[0]

    def _window(self, number: int) -> Window:
        """Where a picture is added: with a margin for the seam and the bands."""
        tight = self._windows[number]
        if tight is None:
            raise ValueError("a picture that shows nothing is not added")
        bands = bands_for(np.broadcast_to(np.False_, tight.with_margin(WINDOW.seam_margin_px).shape))
        return tight.with_margin(max(WINDOW.seam_margin_px, BANDS.margin_widths << bands))

    def _misplaced(self, number: int, window: Window) -> NDArray[np.float32]:
        """px (h, w) by which a picture is expected to be further from its place than what is shown before."""
        out, step = np.empty(window.shape, np.float32), PLACING.step_px
        for there, here in window.parts:
            off, labels = self._placing.at(number, there, step), self._labels[there][::step, ::step]
            for other in np.unique(labels[labels >= 0]).tolist():
                shown = labels == other
                off[shown] -= self._placing.at(other, there, step)[shown]
            across, down = (here[axis].stop - here[axis].start for axis in (1, 0))
            out[here] = cv2.resize(off, (across, down), interpolation=cv2.INTER_NEAREST)
        return out

    def _painted(self, number: int, window: Window, painted: NDArray[np.int8] | None) -> NDArray[np.int8] | None:
        """What was painted between the reference and the others, and which is wanted, as it concerns this picture and
        those before."""
        labels, decided = window.plane(self._labels), None
        if painted is not None:
            here = window.plane(painted)
            decided = -here if number == 0 else np.where(labels == 0, here, np.int8(0))
        return _with_wanted(decided, None if self._wanted is None else window.plane(self._wanted), number, labels)

    def _mark(self, number: int, window: Window, chosen: NDArray[np.bool_] | None) -> None:
        """Remembers what (h, w) a picture shows."""
        for there, here in window.own_parts:
            if chosen is not None:
                self._labels[there][chosen[here]] = number
            if self._count.size:
                self._count[there] += self._layers[number].alpha[there] > 0


def _with_wanted(
    painted: NDArray[np.int8] | None, wanted: NDArray[np.int16] | None, number: int,
    before: NDArray[np.int16] | np.int16,
) -> NDArray[np.int8] | None:  # fmt: skip
    """What was painted (h, w), see `known_labels`, and over it the picture that is wanted (see `wanted_on`), where it
    is the one that is added, or what the panorama before comes from."""
    if wanted is None:
        return painted
    out = np.zeros(wanted.shape, np.int8) if painted is None else painted.copy()
    out[(wanted >= 0) & (wanted == before)] = FIRST
    out[wanted == number] = SECOND
    return out
