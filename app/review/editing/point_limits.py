"""Point limits: far above what people draw, far below what keeps the solver busy for seconds.

A dataset may bring more, as far as ``importing.group_limits`` lets it: such lines can be thinned out
and moved, and get no further points.
"""

from __future__ import annotations

from collections.abc import Sequence

from app.errors import TooManyPointsError
from app.review.editing.edit import Edit, LineChanges, SetLines
from app.soccer.annotation import Lines
from app.soccer.group import Group

MARKING_POINTS = 100
"""Of one marking in one view; the densest of the public datasets has 38."""
VIEW_POINTS = 500
"""Of all markings in one view; the public datasets have at most 85."""
REQUEST_POINTS = 2000
"""Of all lines that one request brings."""


def require_few_points(view: str, lines: Lines, changes: LineChanges) -> None:
    """Refuse new points where a view or a marking of it would have too many.

    Args:
        view: What people call the view or camera.
        lines: As they are.
        changes: What is to become of them.

    Raises:
        TooManyPointsError: With view, marking, count and limit.
    """
    counts = {marking: len(points) for marking, points in lines.items()}
    before = sum(counts.values())
    for marking, points in changes.items():
        count = len(points or ())
        if count > max(MARKING_POINTS, counts.get(marking, 0)):
            raise _too_many(f"{view}: {marking} has {count} points", "a marking", MARKING_POINTS)
        counts[marking] = count
    after = sum(counts.values())
    if after > max(VIEW_POINTS, before):
        names = ", ".join(changes)
        raise _too_many(
            f"{view}: with {names} its lines have {after} points", "a view", VIEW_POINTS
        )


def require_few_points_in_all(group: Group, edits: Sequence[Edit]) -> None:
    """``require_few_points`` for every edit of one request, and for the request as a whole."""
    drawn = [edit for edit in edits if isinstance(edit, SetLines)]
    for edit in drawn:
        view = group.view(edit.view)
        if view is not None:
            require_few_points(f"view {edit.view}", view.station.lines, edit.lines)
    counts = {
        (edit.view, marking): len(points or ())
        for edit in drawn
        for marking, points in edit.lines.items()
    }
    if sum(counts.values()) > REQUEST_POINTS:
        (view_key, marking), count = max(counts.items(), key=lambda item: item[1])
        raise _too_many(
            f"view {view_key}: {marking} brings {count} of {sum(counts.values())} points",
            "a request",
            REQUEST_POINTS,
        )


def _too_many(found: str, what: str, most: int) -> TooManyPointsError:
    return TooManyPointsError(
        f"{found}, {what} may have {most}", hint="Leave points out: a few on each line suffice."
    )
