"""Samples: views as dictionaries of arrays, indexed like a PyTorch dataset, without PyTorch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from touchline.view import View

Transform = Callable[[dict[str, Any]], Any]


class Samples:
    """A map-style dataset: ``len``, an index, and nothing that a worker process could not copy.

    A sample has no None, so that loaders can stack samples; what is not there is NaN.

    Args:
        views: Which.
        images: Whether a sample holds its picture.
        transform: Called with each sample.
    """

    def __init__(
        self, views: Sequence[View], *, images: bool = True, transform: Transform | None = None
    ):
        self.views = tuple(views)
        self._images, self._transform = images, transform

    def __len__(self) -> int:
        """How many samples there are."""
        return len(self.views)

    def __getitem__(self, index: int) -> Any:
        """A sample.

        Keys: ``image`` (height, width, 3) uint8 RGB; ``size`` (width, height); ``box`` x, y, width,
        height and ``center`` x, y of the ball in pixels; ``ball`` x, y, z in metres, pitch frame;
        ``P`` (3, 4), projection to undistorted pixels; ``group``, ``view`` texts.
        """
        view = self.views[index]
        sample = sample_of(view)
        if self._images:
            sample["image"] = view.image()
        return sample if self._transform is None else self._transform(sample)

    def __iter__(self) -> Iterator[Any]:
        """All samples, in their order."""
        return (self[index] for index in range(len(self)))


def sample_of(view: View) -> dict[str, Any]:
    """Everything of a sample but its picture."""
    ball, box = view.ball, view.ball.box if view.ball else None
    sides = None if box is None else (box.x, box.y, box.width, box.height)
    return {
        "group": view.group,
        "view": view.key,
        "size": np.array([view.width, view.height]),
        "box": _numbers(sides, 4),
        "center": _numbers(None if ball is None else ball.center, 2),
        "ball": _numbers(None if view.ball_3d is None else view.ball_3d.position, 3),
        "P": np.full((3, 4), np.nan) if view.camera is None else view.camera.P,
    }


def _numbers(values: Sequence[float] | None, count: int) -> Any:
    return np.full(count, np.nan) if values is None else np.array(values, dtype=np.float64)
