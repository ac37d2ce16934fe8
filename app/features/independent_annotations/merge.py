"""Merging: what a person changed in their copy, brought into the original as it is now.

What they left as it was stays as the original has it by now, whoever changed it there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.soccer.annotation import make_lines
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View


@dataclass(frozen=True)
class MergedGroup:
    """A group with a person's changes; ``both`` names what the original changed otherwise."""

    group: Group
    both: tuple[str, ...]


@dataclass(frozen=True)
class MergedStation:
    """A static camera with a person's changes; ``both`` as in ``MergedGroup``."""

    station: Station
    both: tuple[str, ...]


def merge_group(start: Group, original: Group, own: Group) -> MergedGroup:
    """A person's changes of a group, but for its static cameras.

    Args:
        start: What the person began with, as the original had it then.
        original: The original as it is now.
        own: The copy as it is now, its views called as in the original.
    """
    views, both = list[View](), list[str]()
    for view in original.views:
        copy = own.view(view.key)
        if copy is not None:
            # A view that came later has no start: the person's word counts there.
            view, also = _merge_view(start.view(view.key) or view, view, copy)
            both += also
        views.append(view)
    return MergedGroup(replace(original, views=tuple(views)), tuple(both))


def _merge_view(start: View, original: View, own: View) -> tuple[View, list[str]]:
    merged, both = original, list[str]()
    if own.balls != start.balls:
        merged = replace(merged, balls=own.balls)
        if _is_changed_in_both(start.balls, start.balls, original.balls, own.balls):
            both.append(f"the ball of {original.key}")
    before, there, here = ((view.included, view.left_out) for view in (start, original, own))
    if here != before:
        merged = replace(merged, included=own.included, left_out=own.left_out)
        if _is_changed_in_both(before, before, there, here):
            both.append(f"whether {original.key} is included")
    if not original.station.shared:
        followed = merge_station(
            start.station, original.station, own.station, reference=start.station
        )
        merged = replace(merged, station=followed.station)
        both += [f"{what} of {original.key}" for what in followed.both]
    return merged, both


def merge_station(
    start: Station, original: Station, own: Station, *, reference: Station
) -> MergedStation:
    """A person's changes of a camera, each marking for itself.

    Args:
        start: What the person's camera was before the changes that count.
        original: The original's camera as it is now.
        own: The person's camera as it is now.
        reference: The original's camera as it was when the person's was ``start``.
    """
    states = (start, reference, original, own)
    both, lines = list[str](), dict(original.lines)
    proposed, not_visible = set(original.proposed), set(original.not_visible)
    for name in sorted(set().union(*(_marking_names(station) for station in states))):
        before, then, there, here = (_marking_state(station, name) for station in states)
        if here == before:
            continue
        if _is_changed_in_both(before, then, there, here):
            both.append(name)
        points, is_proposed, is_hidden = here
        lines.pop(name, None)
        if points is not None:
            lines[name] = points
        (proposed.add if is_proposed else proposed.discard)(name)
        (not_visible.add if is_hidden else not_visible.discard)(name)
    calibration, picture = original.calibration, original.picture
    if own.calibration != start.calibration:
        calibration = own.calibration
        if _is_changed_in_both(*(station.calibration for station in states)):
            both.append("the calibration")
    if own.picture != start.picture:
        picture = own.picture
        if _is_changed_in_both(*(station.picture for station in states)):
            both.append("the picture geometry")
    merged = replace(
        original,
        lines=make_lines(lines),
        proposed=tuple(sorted(proposed)),
        not_visible=tuple(sorted(not_visible)),
        calibration=calibration,
        picture=picture,
    )
    return MergedStation(merged, tuple(both))


def _is_changed_in_both(start: object, reference: object, original: object, own: object) -> bool:
    """Whether the person and the original changed the same thing, and each otherwise."""
    return own not in (start, original) and original != reference


def _marking_names(station: Station) -> Sequence[str]:
    return (*station.lines, *station.proposed, *station.not_visible)


def _marking_state(station: Station, name: str) -> tuple[tuple[ImagePoint, ...] | None, bool, bool]:
    """The points of a marking, whether they are as proposed, and whether the picture does not show it."""
    return station.lines.get(name), name in station.proposed, name in station.not_visible
