"""Fixes: what a finding or a remedy proposes, as the edit that carries it out."""

from __future__ import annotations

from dataclasses import replace

from app.review.editing.edit import Edit, IncludeView, LineChanges, SetBall, SetLines
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, View
from app.soccer.pitch import twin_marking
from app.soccer.solution import Fix


def edit_of_fix(group: Group, fix: Fix, point: ImagePoint | None = None) -> Edit | None:
    """The edit that carries out a fix; None when only a person can.

    Args:
        group: The group that the fix is about.
        fix: What to do.
        point: Where ``move_point`` puts its point, pixels of the annotated size.
    """
    view = None if fix.view is None else group.view(fix.view)
    if view is None:
        return None
    if fix.action in ("exclude_view", "include_view"):
        return IncludeView(view.key, fix.action == "include_view")
    if fix.action == "pick_ball":
        chosen = fix.index is not None and fix.index < len(view.balls)
        return SetBall(view.key, view.balls[fix.index or 0]) if chosen else None
    changes = _swapped(view) if fix.action == "swap_sides" else _line_changes(view, fix, point)
    return SetLines(view.key, changes) if changes else None


def ball_at(view: str, ball: BallAnnotation, point: ImagePoint) -> SetBall:
    """The edit that puts a view's ball somewhere else, as large as it is."""
    if ball.box is None:
        return SetBall(view, replace(ball, point=point))
    box = ball.box
    moved = replace(box, x=point.x - box.width / 2, y=point.y - box.height / 2)
    return SetBall(view, replace(ball, box=moved))


def _line_changes(view: View, fix: Fix, point: ImagePoint | None) -> LineChanges | None:
    lines = view.station.lines
    if fix.marking is None or fix.marking not in lines:
        return None
    points = tuple(lines[fix.marking])
    if fix.action == "drop_marking":
        return {fix.marking: None}
    if fix.action == "relabel" and fix.to is not None:
        return {fix.marking: None, fix.to: (*lines.get(fix.to, ()), *points)}
    if fix.index is None or not fix.index < len(points):
        return None
    before, after = points[: fix.index], points[fix.index + 1 :]
    if fix.action == "drop_point":
        return {fix.marking: (*before, *after) or None}
    if fix.action == "move_point" and point is not None:
        return {fix.marking: (*before, point, *after)}
    return None


def _swapped(view: View) -> LineChanges:
    """Every marking under the name that it has when the pitch turns by 180 degrees."""
    lines = view.station.lines
    changes: dict[str, tuple[ImagePoint, ...] | None] = dict.fromkeys(lines)
    for marking, points in lines.items():
        changes[twin_marking(marking)] = tuple(points)
    return changes
