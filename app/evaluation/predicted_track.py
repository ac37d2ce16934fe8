"""Predicted track: the ball in 3D over time, as somebody else says it was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from app.geometry.arrays import FloatArray


@dataclass(frozen=True)
class PredictedTrack:
    """A ball in 3D over time, as somebody predicted it.

    Attributes:
        frames: Numbers, None where the file has times alone.
        times: Seconds, None where the file has numbers alone.
        position: x, y and z in the pitch frame, metres, z down.
        sigma: Standard deviations of these, metres, or None.
        events: Kind, frame and seconds of each; None where no file says any.
    """

    frames: tuple[int | None, ...]
    times: tuple[float | None, ...]
    position: tuple[tuple[float, float, float], ...]
    sigma: tuple[tuple[float, float, float] | None, ...]
    events: tuple[tuple[str, int | None, float | None], ...] | None = None

    def to_json(self) -> dict[str, Any]:
        """As it is kept."""
        return asdict(self)

    @staticmethod
    def from_json(value: Mapping[str, Any]) -> PredictedTrack:
        """Back from ``to_json``."""
        events = value["events"]
        return PredictedTrack(
            tuple(value["frames"]),
            tuple(value["times"]),
            tuple((x, y, z) for x, y, z in value["position"]),
            tuple(None if item is None else (item[0], item[1], item[2]) for item in value["sigma"]),
            None if events is None else tuple((kind, frame, at) for kind, frame, at in events),
        )

    @property
    def sigma_array(self) -> FloatArray:
        """Standard deviations, metres, NaN where there are none, shape (N, 3)."""
        nothing = (np.nan,) * 3
        return np.array([item or nothing for item in self.sigma], dtype=float).reshape(-1, 3)
