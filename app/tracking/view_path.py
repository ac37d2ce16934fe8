"""View path: where a camera looks over time, by which a replay is compared with live shots before anything links them.

Cameras follow play. Two that show the same play look at places some metres apart, whatever they stand and zoom like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera

SPEEDS = (1.0, 0.5, 1 / 3, 0.25)
"""Of replays that are tried."""
STEP_S, GRID_S = 0.2, 0.2
"""Between two places of a path, and between offsets that are tried."""
LEAST_S = 1.0
"""Live seconds that have to be known of both."""
_LEAST_SHARE = 0.8
"""Of the replay that has to lie inside the live shot."""
_LEAST_GAIN = 0.7
"""Share of the distance to which the half turn has to bring a replay to be believed."""
_HALF_TURN = np.array([-1.0, -1.0])


@dataclass(frozen=True)
class ViewPath:
    """Where a camera looks.

    Attributes:
        times: Seconds, ascending, shape (N,).
        places: On the grass, pitch frame, metres, shape (N, 2).
    """

    times: FloatArray
    places: FloatArray

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True)
class PathComparison:
    """How much a replay looks where a live shot does.

    Attributes:
        apart_m: Median distance of the places, metres.
        offset, speed: The map of the times under which that is so, roughly: ``t_live = offset + speed * t_replay``.
        turned: Whether it is so once the cameras of the replay are turned by half a turn of the pitch.
    """

    apart_m: float
    offset: float
    speed: float
    turned: bool


def compute_view_path(times: Sequence[float], cameras: Sequence[Camera | None]) -> ViewPath:
    """Where cameras look through the middle of their pictures, a place each ``STEP_S``.

    Args:
        times: Of the frames, seconds, ascending.
        cameras: One for each frame; None where it has none.
    """
    found, last = [], -np.inf
    for time, camera in zip(times, cameras, strict=True):
        if camera is None or time - last < STEP_S - 1e-6:
            continue
        place = camera.project_to_ground(np.array([camera.principal_point]))[0]
        if np.isfinite(place).all():
            found.append((time, *place.tolist()))
            last = time
    rows = np.array(found).reshape(-1, 3)
    return ViewPath(rows[:, 0], rows[:, 1:])


def compare_paths(live: ViewPath, replay: ViewPath) -> PathComparison | None:
    """How much a replay looks where a live shot does, at the offset and speed that suit it best.

    None where too little is known of one of them, or the live shot is too short for all that the replay shows.
    """
    if min(len(live), len(replay)) < 2 or np.ptp(live.times) < LEAST_S:
        return None
    found = [
        one
        for turn in (False, True)
        if (one := _find_best_alignment(live, replay, turn)) is not None
    ]
    if not found:
        return None
    plain, turned = found
    return turned if turned.apart_m < _LEAST_GAIN * plain.apart_m else plain


def _find_best_alignment(live: ViewPath, replay: ViewPath, turn: bool) -> PathComparison | None:
    places = replay.places * _HALF_TURN if turn else replay.places
    times = replay.times - replay.times[0]
    best: PathComparison | None = None
    for speed in SPEEDS:
        if speed * times[-1] < LEAST_S:
            continue
        slack = (1 - _LEAST_SHARE) * speed * times[-1]
        first, last = live.times[0] - slack, live.times[-1] - speed * times[-1] + slack
        if last < first:
            continue
        offsets = np.arange(first, last + 1e-9, GRID_S)
        shown = offsets[:, None] + speed * times
        apart = np.hypot(
            *(
                np.interp(shown, live.times, live.places[:, axis]) - places[:, axis]
                for axis in (0, 1)
            )
        )
        apart[(shown < live.times[0]) | (shown > live.times[-1])] = np.nan
        middle = np.nanmedian(apart, axis=1)
        at = int(middle.argmin())
        if best is None or middle[at] < best.apart_m:
            offset = float(offsets[at] - speed * replay.times[0])
            best = PathComparison(float(middle[at]), offset, speed, turn)
    return best
