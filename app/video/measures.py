"""Measures: what is kept of each frame of a recording, small enough to keep for every frame.

All are made of a picture of ``SMALL`` pixels, whatever the size and shape of the recording.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

SMALL = (160, 90)
"""Width and height of the picture that is measured, pixels."""
CELLS = (16, 9)
"""Columns and rows of cells whose mean colours are kept."""
HASH_SIDE, HASHED = 32, 8
"""Side of the picture that is hashed, and of the square of its lowest frequencies."""
BINS = 8
"""Of a channel in histograms."""
TORN = 11.0
"""Mean difference within a cell that no motion explains, grey levels."""
UNEXPLAINED = 0.2
"""Residual from which on a fast turn of the camera is looked for."""
LAGS = (0.24, 0.56, 1.2)
"""Seconds over which frames are compared, so that soft transitions are seen."""
MEASURES = np.dtype(
    [
        ("hash", np.uint64),
        ("cells", np.uint8, (CELLS[1], CELLS[0], 3)),
        ("change", np.float32),
        ("histogram", np.float32),
        ("residual", np.float32),
        ("torn", np.uint8),
        ("motion", np.float32),
        ("together", np.float32),
        ("apart", np.float32, (3,)),
        ("recoloured", np.float32, (3,)),
        ("blend", np.float32),
        ("detail", np.float32),
    ]
)
"""Of each frame:

- ``hash``: perceptual hash; frames that look alike differ in few of its 64 bits.
- ``cells``: mean colour of each cell, blue green red, 0 to 255.
- ``change``: mean difference from the frame before, grey levels.
- ``histogram``: share of the colours that is another one than in the frame before, 0 to 1.
- ``residual``: what is left of ``change`` once everything has moved as optical flow says, by the
  contrast of the two frames; about 1 and more: nothing of the one is seen in the other.
- ``torn``: how many cells (of 144) that flow leaves more than ``TORN`` grey levels apart.
- ``motion``: length of the median of that flow, pixels of the small picture.
- ``together``: share of that flow that agrees with its median: of a camera that turns nearly all.
- ``apart``, ``recoloured``: as ``residual`` and ``histogram``, from the frames ``LAGS`` seconds before.
- ``blend``: how far the frame is from the mean of its neighbours, by how far they are from each
  other; 0: it is a blend of them (or all three are equal).
- ``detail``: mean absolute Laplacian, grey levels; small where a picture is blurred.

Of the first frame everything that compares is 0.
"""

Measured = np.ndarray[Any, np.dtype[np.void]]
"""Measures of frames, dtype ``MEASURES``, shape (N,)."""
Picture = npt.NDArray[np.uint8]


class FrameMeasurer:
    """Measures frames one after the other; ``blend`` of each comes with the next one.

    Args:
        fps: Frames a second, about.
    """

    def __init__(self, fps: float) -> None:
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
        self._lags = convert_lags_to_frames(fps)
        self._past: deque[tuple[Picture, Any]] = deque(maxlen=max(self._lags))

    def measure(self, picture: Picture, row: Any, row_before: Any) -> None:
        """Measure a frame.

        Args:
            picture: Blue green red, shape (H, W, 3).
            row: Gets its measures, a record of ``MEASURES``.
            row_before: Record of the frame before, whose ``blend`` is now known; None: there is none.
        """
        small = cv2.resize(picture, SMALL, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
        row["hash"] = compute_perceptual_hash(grey)
        row["cells"] = cv2.resize(small, CELLS, interpolation=cv2.INTER_AREA)
        row["detail"] = np.abs(cv2.Laplacian(grey, cv2.CV_16S)).mean()
        colours = cv2.calcHist([small], [0, 1, 2], None, [BINS] * 3, [0, 256] * 3)
        past = self._past
        if past:
            before, colours_before = past[-1]
            row["change"] = cv2.absdiff(grey, before).mean()
            row["histogram"] = _measure_colour_change(colours, colours_before)
            row["residual"], flow, left = self._compute_motion_residual(before, grey)
            row["torn"] = (cv2.resize(left, CELLS, interpolation=cv2.INTER_AREA) > TORN).sum()
            row["motion"], row["together"] = _summarize_flow(flow)
            if len(past) > 1 and row_before is not None:
                row_before["blend"] = _measure_blend(past[-2][0], before, grey)
        for at, lag in enumerate(self._lags):
            if len(past) >= lag:
                before, colours_before = past[-lag]
                row["recoloured"][at] = _measure_colour_change(colours, colours_before)
                row["apart"][at] = self._compute_motion_residual(before, grey)[0]
        past.append((grey, colours))

    def _compute_motion_residual(self, before: Picture, grey: Picture) -> tuple[float, Any, Any]:
        """What no motion explains, by the contrast; the motion; what it leaves of each pixel."""
        found = self._compensate_motion(before, grey, (0.0, 0.0))
        if found[0] < UNEXPLAINED:
            return found
        # Optical flow loses a camera that turns fast, correlation does not.
        shift, _ = cv2.phaseCorrelate(grey.astype(np.float32), before.astype(np.float32), _WINDOW)
        if max(abs(shift[0]), abs(shift[1])) < 2.0:
            return found
        return min(found, self._compensate_motion(before, grey, shift), key=lambda one: one[0])

    def _compensate_motion(
        self, before: Picture, grey: Picture, shift: Sequence[float]
    ) -> tuple[float, Any, Any]:
        start = np.empty((*grey.shape, 2), np.float32)
        start[:] = shift
        flow = self._flow.calc(grey, before, start)
        columns, rows = cv2.split(flow + _PLACES)
        moved = cv2.remap(before, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        contrast = (float(grey.std()) + float(before.std())) / 2
        left = cv2.absdiff(grey, moved)
        return float(left.mean()) / max(contrast, 1.0), flow, left


def convert_lags_to_frames(fps: float) -> list[int]:
    """``LAGS`` in frames."""
    return [max(round(lag * min(max(fps, 10.0), 120.0)), 2) for lag in LAGS]


def _measure_colour_change(colours: Any, before: Any) -> float:
    return float(np.abs(colours - before).sum()) / (2 * SMALL[0] * SMALL[1])


def _summarize_flow(flow: Any) -> tuple[float, float]:
    """Length of the median of a flow, and share of it that agrees with that."""
    sparse = flow[::3, ::3].reshape(-1, 2)
    middle = np.median(sparse, axis=0)
    length = float(np.hypot(*middle))
    off = np.hypot(*(sparse - middle).T)
    return length, float((off < max(0.25 * length, 1.0)).mean())


_PLACES = np.stack(np.meshgrid(np.arange(SMALL[0]), np.arange(SMALL[1])), axis=-1).astype(
    np.float32
)


_WINDOW = cv2.createHanningWindow(SMALL, cv2.CV_32F)


def compute_perceptual_hash(grey: Picture) -> int:
    """64 bits: which of the lowest frequencies of a picture are above their median.

    Args:
        grey: Grey levels, shape (H, W).

    Source: C. Zauner, "Implementation and benchmarking of perceptual image hash functions" (2010), pHash.
    """
    side = (HASH_SIDE, HASH_SIDE)
    small = cv2.resize(grey, side, interpolation=cv2.INTER_AREA).astype(np.float32)
    lowest = np.asarray(cv2.dct(small))[:HASHED, :HASHED].ravel()
    bits = lowest > np.median(lowest)
    return int.from_bytes(np.packbits(bits).tobytes(), "big")


def hash_distance(one: npt.NDArray[np.uint64], other: npt.NDArray[np.uint64]) -> Any:
    """In how many of their 64 bits hashes differ."""
    return np.bitwise_count(np.bitwise_xor(one, other))


def _measure_blend(before: Picture, grey: Picture, after: Picture) -> float:
    apart = cv2.absdiff(before, after).mean()
    middle = cv2.addWeighted(before, 0.5, after, 0.5, 0)
    return float(cv2.absdiff(grey, middle).mean()) / max(float(apart), 0.5)


COMB_EVERY = 25
"""Frames between two that are looked at for combs."""
COMB_SHARE, COMBED = 1.4, 0.15
"""How much rougher lines of both fields are than those of one, and share of the moving frames
that are so from which on a recording counts as interlaced."""
_COMB_COLUMNS = 240


def measure_combing(picture: Picture) -> float:
    """How much more neighbouring lines differ than lines two apart; above 1 lie two fields.

    Args:
        picture: Blue green red, in its coded size, shape (H, W, 3).
    """
    step = max(picture.shape[1] // _COMB_COLUMNS, 1)
    green = picture[:, ::step, 1].astype(np.int16)
    near = np.abs(green[1:-1] * 2 - green[:-2] - green[2:]) / 2
    far = np.abs(green[2:] - green[:-2])
    rough = np.percentile(near, 95), np.percentile(far, 95)
    return float(rough[0] / max(rough[1], 4.0))


class GrowingMeasures:
    """Measures of a recording whose length is not known beforehand."""

    def __init__(self) -> None:
        self._rows: Measured = np.zeros(1024, MEASURES)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append_row(self) -> tuple[Any, Any]:
        """A new record, and the one before it (None: it is the first)."""
        if self._count == len(self._rows):
            grown: Measured = np.zeros(len(self._rows) * 3 // 2, MEASURES)
            grown[: self._count] = self._rows
            self._rows = grown
        self._count += 1
        before = self._rows[self._count - 2] if self._count > 1 else None
        return self._rows[self._count - 1], before

    def get_measured_rows(self) -> Measured:
        """All of them."""
        return self._rows[: self._count]
