"""Replays: told by the logo that a broadcaster flies in before and after each of them.

Every wipe of a recording has a few frames that the logo fills; those of one logo look alike wherever
it flies, however different the shots beside it are. Wipes that share such frames are one cluster.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.geometry.arrays import BoolArray
from app.video.measures import Measured, hash_distance

MOST_APART, MOST_CELLS = 14, 26.0
"""Frames of the same logo: bits of their hashes that differ, and mean distance of their cells."""
LEAST_FOREIGN = 18.0
"""Mean distance of a logo's frame from any mix of the shots beside it, grey levels."""
LEAST_SEEN = 3
"""Wipes of one logo from which on it marks replays; two do where a stretch lies between them."""
LONGEST_SECONDS = 75.0
"""Longest stretch between two wipes of one logo that is one replay, or several in a row."""
LIKE_MAIN, ALONE = 0.3, 0.5
"""What a stretch counts as a replay that looks like the main camera, where another counts 1; and what a wipe costs that opens and closes none."""
LEAST_ALIKE = 2
"""Frames that two wipes of one logo share."""


def cluster_logos(rows: Measured, intervals: Sequence[tuple[int, int]]) -> list[int | None]:
    """Which logo each soft transition flies: a number of a cluster, or None.

    Args:
        rows: Measures of the frames.
        intervals: First and last frame of each transition, in order.
    """
    found: list[int | None] = [None] * len(intervals)
    clusters: list[list[int]] = []
    for at in range(len(intervals)):
        for number, members in enumerate(clusters):
            if any(_have_same_logo(rows, intervals[at], intervals[other]) for other in members):
                members.append(at)
                found[at] = number
                break
        else:
            found[at] = len(clusters)
            clusters.append([at])
    return [
        number if number is not None and len(clusters[number]) > 1 else None for number in found
    ]


def _have_same_logo(rows: Measured, one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether some frames within two transitions are pictures of one thing, in the same order."""
    ours, theirs = (rows[first : last + 1] for first, last in (one, other))
    bits = hash_distance(ours["hash"][:, None], theirs["hash"][None, :])
    cells = [each["cells"].reshape(len(each), -1).astype(np.float32) for each in (ours, theirs)]
    apart = np.abs(cells[0][:, None] - cells[1][None, :]).mean(axis=2)
    same = (bits <= MOST_APART) & (apart < MOST_CELLS)
    same &= _find_foreign_frames(rows, one)[:, None] & _find_foreign_frames(rows, other)[None, :]
    return int(same.any(axis=1).sum()) >= LEAST_ALIKE and int(same.any(axis=0).sum()) >= LEAST_ALIKE


def _find_foreign_frames(rows: Measured, interval: tuple[int, int]) -> BoolArray:
    """Which frames of a transition show something that belongs to neither shot, and to no mix of them."""
    first, last = interval
    old, new = (
        rows["cells"][beside].ravel().astype(np.float64)
        for beside in (max(first - 1, 0), min(last + 1, len(rows) - 1))
    )
    cells = rows["cells"][first : last + 1].reshape(last - first + 1, -1).astype(np.float64)
    # Darker and lighter mixes as well: a fade is none.
    basis = np.linalg.qr(np.stack([old, new, np.ones_like(old)], axis=1))[0]
    left = np.abs(cells - cells @ basis @ basis.T).mean(axis=1)
    return np.asarray(left > LEAST_FOREIGN)


def find_shots_between_logos(
    clusters: Sequence[int | None],
    seconds: Sequence[tuple[float, float]],
    main: Sequence[bool],
) -> BoolArray:
    """Which shots are replays: those between a wipe of a logo and its next one.

    Args:
        clusters: Of the transition before each shot but the first one, in order; None: no logo.
        seconds: When each shot begins and ends.
        main: Which shots show the main camera at its own pace.

    Returns:
        Shape (shots,).
    """
    replay = np.zeros(len(seconds), np.bool_)
    for cluster in {number for number in clusters if number is not None}:
        places = [at for at, number in enumerate(clusters, 1) if number == cluster]
        if len(places) < LEAST_SEEN and len(places) != 2:
            continue
        for start, stop in _pair_logo_wipes(places, seconds, main):
            replay[start:stop] = True
    return replay


def _pair_logo_wipes(
    places: Sequence[int], seconds: Sequence[tuple[float, float]], main: Sequence[bool]
) -> list[tuple[int, int]]:
    """Wipes that open and close a replay: first shot behind each, and first shot after it.

    A wipe that opens and one that closes take turns; where one was missed the turns begin anew. Of all
    ways to pair them this is the likeliest: what lies between two is short and shows another camera than
    the main one, or shows it slowly; paint tells where some cameras of replays stand, too, so that those look like it.
    """
    best: list[tuple[float, list[tuple[int, int]]]] = [(0.0, [])]
    for at, stop in enumerate(places, 1):
        score, found = best[-1]
        options = [(score - ALONE, found)]
        if at > 1:
            start = places[at - 2]
            length = seconds[stop - 1][1] - seconds[start][0]
            shown = sum(seconds[k][1] - seconds[k][0] for k in range(start, stop) if main[k])
            if length <= LONGEST_SECONDS:
                score, found = best[-2]
                score += LIKE_MAIN if shown >= 0.5 * length else 1.0
                options.append((score - length / LONGEST_SECONDS / 10, [*found, (start, stop)]))
        best.append(max(options, key=lambda option: option[0]))
    return best[-1][1]
