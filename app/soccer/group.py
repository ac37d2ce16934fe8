"""Group: the views of one instant with their frames, the unit of review and of solving."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath, PurePosixPath
from string import ascii_uppercase
from typing import Literal, get_args

from app.errors import InputError
from app.geometry.camera import Camera
from app.object_store.path import is_address
from app.soccer.annotation import BallAnnotation, Extras, Lines
from app.soccer.choices import CalibrationChoice
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch

Reason = Literal[
    "bad_field_lines",
    "sides_confused",
    "not_same_instant",
    "ball_not_visible",
    "bad_calibration",
    "duplicate_view",
    "other",
]
"""``other`` needs a note."""
REASONS: tuple[str, ...] = get_args(Reason)
MAX_NOTE = 2000
"""Characters."""


@dataclass(frozen=True)
class ViewExclusion:
    """Why a person left a view out of its group; ``note`` says it in their own words."""

    reason: str
    note: str | None = None


def make_view_exclusion(reason: str | None, note: str | None) -> ViewExclusion | None:
    """What a person says of a view that is left out; None when they say nothing.

    Raises:
        InputError: The reason is none, or a note is missing, stands alone or is too long.
    """
    note = strip_and_check_note(note)
    if reason is None and note is None:
        return None
    if reason not in REASONS:
        known = ", ".join(REASONS)
        problem = (
            "a note needs a reason beside it" if reason is None else f'"{reason}" is not a reason'
        )
        raise InputError(f"{problem}; reasons are {known}", pointer="/reason")
    require_exclusion_note(reason, note)
    return ViewExclusion(reason, note)


def strip_and_check_note(note: str | None) -> str | None:
    """A note without white space around it; None where nothing is left.

    Raises:
        InputError: It is too long.
    """
    note = (note or "").strip() or None
    if note is not None and len(note) > MAX_NOTE:
        raise InputError(
            f"the note has {len(note):,} characters; the limit is {MAX_NOTE:,}",
            pointer="/note",
        )
    return note


def require_exclusion_note(reason: str | None, note: str | None) -> None:
    """Raise InputError where a reason says nothing by itself, and no note does."""
    if reason == "other" and note is None:
        raise InputError('the reason "other" needs a note', pointer="/note")


@dataclass(frozen=True)
class Media:
    """Where the frame of a view can be read: a file, or a member of an archive."""

    path: str
    member: str | None = None
    frame: int | None = None
    """Number of the frame when ``path`` is a video."""


FARTHEST = 5
"""Frames before and after that are looked for."""
CLIP_FOLDER = "img1"
"""Holds the frames of one clip in their order (SoccerNet game state, MOT)."""
_NUMBERED = re.compile(r"(.*?)([0-9]{1,12})", re.DOTALL)
_LAST_NUMBER = re.compile(r"([0-9]+)[^0-9]*")


def is_numbered_in_time(media: Media, group: str, static: bool) -> bool:
    """Whether the name of a frame counts time, so that there may be neighbours.

    Args:
        media: Where the frame lies; one in an object store has no neighbours, for each of which the
            store would have to be asked.
        group: Key of the group, which is the number of its frame for static cameras.
        static: Whether the camera stands still, so that its files are numbered by frames.
    """
    if is_address(media.path):
        return False
    return media.frame is not None or split_frame_number(media, group, static) is not None


def split_frame_number(media: Media, group: str, static: bool) -> tuple[PurePath, str, str] | None:
    """Name of a frame, what stands before its number, and the number; None: it counts no time."""
    name = PurePosixPath(media.member) if media.member is not None else PurePath(media.path)
    found = _NUMBERED.fullmatch(name.stem)
    if found is None:
        return None
    by_frame = static and _find_last_number(group) == int(found[2])
    if not by_frame and name.parent.name != CLIP_FOLDER:
        return None
    return name, found[1], found[2]


def _find_last_number(group: str) -> int | None:
    found = _LAST_NUMBER.search(group.rsplit("/", 1)[-1])
    return int(found[1]) if found else None


CALIBRATIONS: tuple[str, ...] = get_args(CalibrationChoice)


def make_view_letter(index: int) -> str:
    """What people call the view at that place of its group: A, B, ..., Z, V27, V28, ..."""
    return ascii_uppercase[index] if index < len(ascii_uppercase) else f"V{index + 1}"


@dataclass(frozen=True)
class Station:
    """A camera that stands still for all views that share it; it owns lines and calibration.

    A broadcast view has a station of its own (``shared`` is False).

    Attributes:
        key: Unique in the dataset, ``cam3`` or the key of its only view.
        given: Calibration that came with the data, or None.
        calibration: Which one counts when both exist, one of ``CALIBRATIONS``.
        given_covariance: Of the given camera's parameters (``geometry.resection``), 8 x 8, row by
            row; None where nothing is known of it.
        picture: What was done to its pictures since they were taken; None: nothing. The camera
            that is found from its lines follows.
        proposed: Markings whose points a person accepted as they were proposed from the paint,
            sorted; what is drawn or moved later is not among them.
        not_visible: Markings of which a person said that the picture does not show them, sorted:
            something hides them, or they are worn. JaC does not count them as missing.
    """

    key: str
    size: ImageSize
    shared: bool = False
    lines: Lines = field(default_factory=dict)
    given: Camera | None = None
    calibration: str = "given"
    flipped: bool = False
    """The frames of this camera are mirrored; annotations and calibration are not."""
    given_covariance: tuple[float, ...] | None = None
    picture: PictureGeometry | None = None
    proposed: tuple[str, ...] = ()
    not_visible: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.given is not None and self.given.is_wide and self.given_covariance is not None:
            raise InputError(
                f"the covariance of camera {self.key} is that of a lens with one radial term, and"
                f" its lens is {self.given.lens}",
                hint="Leave the covariance out: the noise of given cameras stands in the policy.",
            )

    def with_annotations_of(self, other: Station) -> Station:
        """This station with the lines, the camera and the picture that were said of another."""
        return replace(
            self,
            lines=other.lines,
            proposed=other.proposed,
            not_visible=other.not_visible,
            given=other.given,
            given_covariance=other.given_covariance,
            calibration=other.calibration,
            picture=other.picture,
        )

    @property
    def lines_with_not_visible(self) -> Lines:
        """The lines, and those that are said not to be visible, without points: as they are kept."""
        if not self.not_visible:
            return self.lines
        lines = {**self.lines, **dict.fromkeys(self.not_visible, ())}
        return {marking: lines[marking] for marking in sorted(lines)}

    def with_given_camera(
        self, given: Camera | None, covariance: tuple[float, ...] | None = None
    ) -> Station:
        """This station with another given camera; what was known of the old one is not of it."""
        return replace(self, given=given, given_covariance=covariance)


@dataclass(frozen=True)
class View:
    """One image of one instant: its camera station, and the balls seen in it."""

    key: str
    station: Station
    balls: tuple[BallAnnotation, ...] = ()
    media: Media | None = None
    included: bool = True
    """False when a person left this view out of the group."""
    extras: Extras = field(default_factory=Extras)
    left_out: ViewExclusion | None = None
    """Why it was left out, where the person said so; None while it is included."""
    noise: float = 1.0
    """How noisy the place of its ball is: sigma beside that of the dataset's balls."""

    @property
    def size(self) -> ImageSize:
        """Annotated size of the image."""
        return self.station.size

    @property
    def can_use_paint(self) -> bool:
        """Whether the paint of its picture could place its camera.

        A static camera is that of many pictures, a given one is what it is, and a picture that was
        stretched or cropped has no lens of one radial term about its middle.
        """
        station = self.station
        is_given = station.given is not None and station.calibration == "given"
        return bool(station.lines) and not (station.shared or is_given or station.picture)

    @property
    def ball(self) -> BallAnnotation | None:
        """The ball of this view; None when there is none, or several to pick from."""
        seen = [ball for ball in self.balls if not ball.out_of_view]
        return seen[0] if len(seen) == 1 else None


@dataclass(frozen=True)
class SharedPosition:
    """Where the other pictures of a match put the camera of a view; pitch frame, metres.

    Attributes:
        mean: x, y and z.
        sigma: Standard deviation of each.
    """

    mean: tuple[float, float, float]
    sigma: tuple[float, float, float]


@dataclass(frozen=True)
class Group:
    """Views of the same instant, ordered, the main camera first.

    Attributes:
        key: ``<league>/<season>/<match>/7.png`` (SoccerNet) or the frame number (ISSIA).
        match: Key of the match or station set, which owns the pitch size.
        split: ``train``, ``test``, ``valid`` or empty.
        label: What people read: teams and time of play.
        positions: What the match's other pictures say of where the camera of a view stands, by
            the view's key, as it was accepted for the match.
        paint: What was read of the paint in a view's picture, by the view's key.
    """

    key: str
    views: tuple[View, ...]
    match: str = ""
    pitch: Pitch = field(default_factory=Pitch)
    split: str = ""
    label: str = ""
    positions: Mapping[str, SharedPosition] = field(default_factory=dict)
    paint: Mapping[str, PaintReading] = field(default_factory=dict)

    @property
    def noise_factors_by_view(self) -> dict[str, float]:
        """How noisy balls are, where that is unlike the dataset's, by the view's key."""
        return {view.key: view.noise for view in self.views if view.noise != 1}

    def view(self, key: str) -> View | None:
        """The view of that key, or None."""
        return next((view for view in self.views if view.key == key), None)

    def with_view(self, view: View) -> Group:
        """The same group with the view of that key replaced."""
        views = tuple(view if old.key == view.key else old for old in self.views)
        return replace(self, views=views)
