"""Edits: values that know how to make the next group, and the edit that leads back.

They know neither session, user nor solver.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from app.errors import InputError, NotFoundError
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Lines, make_lines
from app.soccer.frames import MAX_PIXEL, ImagePoint
from app.soccer.group import CALIBRATIONS, Group, SharedPosition, Station, View, make_view_exclusion
from app.soccer.paint_evidence import PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch, canonical_marking

MAX_POINTS = 1000
"""Most points of one marking."""

LineChanges = Mapping[str, tuple[ImagePoint, ...] | None]
"""New points by marking; None or no points deletes the marking, absent ones stay."""


class Edit(Protocol):
    """A change of one group."""

    def apply(self, group: Group) -> Group:
        """The next group.

        Raises:
            InputError: The edit does not fit the group or says something impossible.
            NotFoundError: The group has no such view.
        """

    def inverse(self, group: Group) -> Edit:
        """The edit that leads from ``apply(group)`` back to ``group``."""


class StationEdit(Protocol):
    """A change of one station."""

    def apply(self, station: Station) -> Station:
        """The next station; raises InputError as ``Edit.apply`` does."""

    def inverse(self, station: Station) -> StationEdit:
        """The edit that leads from ``apply(station)`` back to ``station``."""


@dataclass(frozen=True)
class SetStationLines:
    """Draw, move or delete markings as one camera sees them."""

    lines: LineChanges
    proposed: tuple[str, ...] = ()
    """The markings whose points are as they were proposed."""
    not_visible: tuple[str, ...] = ()
    """The markings without points that the picture does not show."""

    def apply(self, station: Station) -> Station:
        """The station with these markings."""
        lines, accepted = dict(station.lines), set(map(canonical_marking, self.proposed))
        own, unseen = set(station.proposed), set(station.not_visible)
        hidden = set(map(canonical_marking, self.not_visible))
        for name, points in self.lines.items():
            marking = canonical_marking(name)
            if points:
                lines[marking] = _validate_points(marking, points)
            else:
                lines.pop(marking, None)
            own.discard(marking)
            unseen.discard(marking)
            if points and marking in accepted:
                own.add(marking)
            if not points and marking in hidden:
                unseen.add(marking)
        return replace(
            station,
            lines=make_lines(lines),
            proposed=tuple(sorted(own)),
            not_visible=tuple(sorted(unseen)),
        )

    def inverse(self, station: Station) -> SetStationLines:
        """Each changed marking as it was before."""
        before = _select_original_lines(station.lines, self.lines)
        proposed, unseen = (
            tuple(name for name in names if name in before)
            for names in (station.proposed, station.not_visible)
        )
        return SetStationLines(before, proposed, unseen)


@dataclass(frozen=True)
class SetStationCalibrationSource:
    """Choose which calibration of a station counts: ``given`` or ``lines``.

    ``given`` without a given camera is no contradiction: the lines count then.
    """

    calibration: str

    def apply(self, station: Station) -> Station:
        """The station with that choice."""
        if self.calibration not in CALIBRATIONS:
            raise InputError('calibration must be "given" or "lines"', pointer="/calibration")
        return replace(station, calibration=self.calibration)

    def inverse(self, station: Station) -> SetStationCalibrationSource:
        """The choice as it was."""
        return SetStationCalibrationSource(station.calibration)


@dataclass(frozen=True)
class SetStationCamera:
    """Give a station another camera, with what is known of its uncertainty; it counts then.

    ``covariance`` is that of the camera's parameters, 8 x 8, row by row, or None.
    """

    given: Camera | None
    covariance: tuple[float, ...] | None = None
    calibration: str = "given"

    def apply(self, station: Station) -> Station:
        """The station with that camera."""
        if self.given is None and self.covariance is not None:
            raise InputError(
                "`covariance` needs a camera in `given`",
                pointer="/covariance",
            )
        return replace(
            station,
            given=self.given,
            given_covariance=self.covariance,
            calibration=self.calibration,
        )

    def inverse(self, station: Station) -> SetStationCamera:
        """The camera as it was."""
        return SetStationCamera(station.given, station.given_covariance, station.calibration)


@dataclass(frozen=True)
class SetLines:
    """Draw, move or delete markings of one view."""

    view: str
    lines: LineChanges
    proposed: tuple[str, ...] = ()
    """The markings whose points are as they were proposed."""
    not_visible: tuple[str, ...] = ()
    """The markings without points that the picture does not show."""

    def apply(self, group: Group) -> Group:
        """The group with these markings in the view (and in others that share its station)."""
        view = require_view(group, self.view)
        return replace_station_in_group(group, view, self._as_station_edit.apply(view.station))

    def inverse(self, group: Group) -> SetLines:
        """Each changed marking as it was before."""
        before = self._as_station_edit.inverse(require_view(group, self.view).station)
        return SetLines(self.view, before.lines, before.proposed, before.not_visible)

    @property
    def _as_station_edit(self) -> SetStationLines:
        return SetStationLines(self.lines, self.proposed, self.not_visible)


@dataclass(frozen=True)
class SetCalibrationSource:
    """Choose which calibration of a view counts: ``given`` or ``lines``."""

    view: str
    calibration: str

    def apply(self, group: Group) -> Group:
        """The group with that choice."""
        view = require_view(group, self.view)
        station = SetStationCalibrationSource(self.calibration).apply(view.station)
        return replace_station_in_group(group, view, station)

    def inverse(self, group: Group) -> SetCalibrationSource:
        """The choice as it was."""
        return SetCalibrationSource(self.view, require_view(group, self.view).station.calibration)


@dataclass(frozen=True)
class SetPictureGeometry:
    """Say what was done to the picture of a view since it was taken; None: nothing.

    Where its sigma is wide, the lines of the view say themselves how much.
    """

    view: str
    picture: PictureGeometry | None

    def apply(self, group: Group) -> Group:
        """The group with this picture in the view."""
        view = require_view(group, self.view)
        return replace_station_in_group(group, view, replace(view.station, picture=self.picture))

    def inverse(self, group: Group) -> SetPictureGeometry:
        """The picture as it was."""
        return SetPictureGeometry(self.view, require_view(group, self.view).station.picture)


@dataclass(frozen=True)
class SetBalls:
    """Replace all balls of a view."""

    view: str
    balls: tuple[BallAnnotation, ...]
    noise: float = 1.0
    """Of whoever says it with this camera, beside that of the dataset's balls."""

    def apply(self, group: Group) -> Group:
        """The group with these balls in the view."""
        for ball in self.balls:
            _check_ball(ball)
        view = require_view(group, self.view)
        return group.with_view(replace(view, balls=self.balls, noise=self.noise))

    def inverse(self, group: Group) -> SetBalls:
        """The balls as they were."""
        view = require_view(group, self.view)
        return SetBalls(self.view, view.balls, view.noise)


def make_set_ball_edit(view: str, ball: BallAnnotation | None) -> SetBalls:
    """Say which one ball a view shows; None: no ball is annotated."""
    return SetBalls(view, () if ball is None else (ball,))


@dataclass(frozen=True)
class SetViewInclusion:
    """Leave a view out of its group, or take it in again."""

    view: str
    included: bool
    reason: str | None = None
    """Why it is left out, one of ``REASONS``; ``note`` says it in the person's own words."""
    note: str | None = None

    def apply(self, group: Group) -> Group:
        """The group with or without the view."""
        why = make_view_exclusion(self.reason, self.note)
        if self.included and why is not None:
            raise InputError("only a left-out view can have a reason", pointer="/reason")
        view = require_view(group, self.view)
        return group.with_view(replace(view, included=self.included, left_out=why))

    def inverse(self, group: Group) -> SetViewInclusion:
        """The view as it was."""
        view = require_view(group, self.view)
        if view.included or view.left_out is None:
            return SetViewInclusion(self.view, view.included)
        return SetViewInclusion(self.view, False, view.left_out.reason, view.left_out.note)


@dataclass(frozen=True)
class SetPitch:
    """Say how long and wide the pitch is, metres; the groups of a match get it together."""

    length: float
    width: float

    def apply(self, group: Group) -> Group:
        """The group on a pitch of this size."""
        return replace(group, pitch=Pitch(self.length, self.width))

    def inverse(self, group: Group) -> SetPitch:
        """The size as it was."""
        return SetPitch(group.pitch.length, group.pitch.width)


@dataclass(frozen=True)
class SetCameraPositions:
    """Say where the match's other pictures put the cameras of a group's views, by view."""

    positions: Mapping[str, SharedPosition]

    def apply(self, group: Group) -> Group:
        """The group with these positions, for views that it has."""
        known = {view: at for view, at in self.positions.items() if group.view(view) is not None}
        return replace(group, positions=known)

    def inverse(self, group: Group) -> SetCameraPositions:
        """The positions as they were."""
        return SetCameraPositions(group.positions)


@dataclass(frozen=True)
class SetPaintReadings:
    """Say what was read of the paint in the pictures of a group's views, by view."""

    paint: Mapping[str, PaintReading]

    def apply(self, group: Group) -> Group:
        """The group with these readings, for views that it has."""
        known = {view: read for view, read in self.paint.items() if group.view(view) is not None}
        return replace(group, paint=known)

    def inverse(self, group: Group) -> SetPaintReadings:
        """The readings as they were."""
        return SetPaintReadings(group.paint)


@dataclass(frozen=True)
class SetBallNoise:
    """Say how noisy the balls of a group's views are beside the dataset's; others are like it."""

    noise: Mapping[str, float]

    def apply(self, group: Group) -> Group:
        """The group with this noise, for views that it has."""
        views = (replace(view, noise=self.noise.get(view.key, 1.0)) for view in group.views)
        return replace(group, views=tuple(views))

    def inverse(self, group: Group) -> SetBallNoise:
        """The noise as it was."""
        return SetBallNoise(group.noise_factors_by_view)


@dataclass(frozen=True)
class CompositeEdit:
    """Edits that are one: done one after the other, and taken back together."""

    edits: tuple[Edit, ...]

    def apply(self, group: Group) -> Group:
        """The group after all of them."""
        for edit in self.edits:
            group = edit.apply(group)
        return group

    def inverse(self, group: Group) -> CompositeEdit:
        """The edits that undo these, the last one first."""
        back: list[Edit] = []
        for edit in self.edits:
            back.insert(0, edit.inverse(group))
            group = edit.apply(group)
        return CompositeEdit(tuple(back))


STATION_EDITS = (SetLines, SetCalibrationSource, SetPictureGeometry)
"""Edits of a view that belong to its station when that is shared."""


def require_view(group: Group, key: str) -> View:
    """The view of that key.

    Raises:
        NotFoundError: There is none.
    """
    view = group.view(key)
    if view is None:
        raise NotFoundError(f"group {group.key} has no view {key}")
    return view


def replace_station_in_group(group: Group, view: View, station: Station) -> Group:
    """The group with a view's station replaced, in each view that shares it."""
    for other in group.views:
        same = other.key == view.key
        if same or (station.shared and other.station.key == station.key):
            group = group.with_view(replace(other, station=station))
    return group


def _select_original_lines(lines: Lines, changes: LineChanges) -> LineChanges:
    names = map(canonical_marking, changes)
    return {name: tuple(lines[name]) if name in lines else None for name in names}


def _validate_points(marking: str, points: tuple[ImagePoint, ...]) -> tuple[ImagePoint, ...]:
    if len(points) > MAX_POINTS:
        raise InputError(f"{marking} has more than {MAX_POINTS} points")
    for index, point in enumerate(points):
        if not all(math.isfinite(value) and abs(value) <= MAX_PIXEL for value in point):
            pointer = f"/lines/{marking.replace('~', '~0').replace('/', '~1')}/{index}"
            raise InputError(
                f"point {index + 1} of {marking} is not a valid pixel coordinate",
                pointer=pointer,
            )
    return points


def _check_ball(ball: BallAnnotation) -> None:
    if ball.box is not None and ball.point is not None:
        raise InputError("a ball has a box or a point, not both", pointer="/point")
    if ball.box is None and ball.point is None and not ball.out_of_view:
        raise InputError("a ball needs a box or a point unless it is out of view")
    numbers: list[float] = list(ball.point or ())
    if ball.box is not None:
        numbers += [ball.box.x, ball.box.y, ball.box.width, ball.box.height]
        if not (ball.box.width > 0 and ball.box.height > 0):
            raise InputError("a ball's box needs a width and a height above zero", pointer="/box")
    if not all(math.isfinite(value) and abs(value) <= MAX_PIXEL for value in numbers):
        raise InputError(
            "the position of the ball is not a valid pixel coordinate",
            pointer="/box" if ball.box else "/point",
        )
