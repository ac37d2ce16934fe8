"""View paint: the frame of a view asked for its painted lines; nothing is saved.

Frames are read in the processes that make pictures: what is wrong with one ends there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from app.child_pool import PoolTask
from app.errors import NotFoundError
from app.geometry.camera import Camera
from app.paint.view_paint import read_paint
from app.paint.view_proposal import propose_lines
from app.review.editing.edit import LineChanges, SetLines
from app.review.editing.known import known_calibrations
from app.review.editing.point_limits import require_few_points_in_all
from app.soccer.group import Group, Media, View
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_clicks, clicks_key, view_key
from app.store.frames import Frames
from app.store.groups import StoredGroup, group_of_view, read_groups
from app.store.pitches import groups_of_match
from app.store.session import Session, Store

MOST_KNOWN = 12
"""Groups of a match whose cameras say where to look first; one stand needs no more."""
NO_FRAME_HINT = (
    "The import's report says why; importing again after the files are mended attaches the frames."
)


@dataclass(frozen=True)
class PaintQuestion:
    """A view as its lines are now, and the camera that they make.

    Attributes:
        known: Cameras of other groups of the match; for proposals.
    """

    group: Group
    view: View
    media: Media
    policy: CalibrationPolicy
    start: Calibration | None = None
    known: tuple[Camera, ...] = ()

    def ask_paint(self, frames: Frames) -> PoolTask:
        """Have the paint read near the camera; the result is a ``ViewPaint``."""
        station = self.view.station
        return frames.ask_of(
            self.media, station.flipped, read_paint,
            station.size, self.start, self.group.pitch, self.policy, self.view.extras.places,
        )  # fmt: skip

    def ask_proposal(self, frames: Frames) -> PoolTask:
        """Have lines proposed; the result is a ``ViewProposal``."""
        station = self.view.station
        return frames.ask_of(
            self.media, station.flipped, propose_lines,
            station.size, self.known, self.group.pitch, self.policy,
        )  # fmt: skip


def paint_question(store: Store, view_id: int, lines: LineChanges) -> PaintQuestion:
    """What to ask about a view whose lines are changed like this, unsaved.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
        InputError: The lines say something impossible.
    """
    with store.read() as session:
        stored, view = _find(session, view_id)
        edit = SetLines(view.key, lines)
        require_few_points_in_all(stored.group, [edit])
        group = edit.apply(stored.group)
        policy = stored.policy
        known = known_calibrations(session, [group], policy)
    changed = next(item for item in group.views if item.key == view.key)
    # What the lines alone make: what was read of the paint before has no part in what is read.
    start = known.get(clicks_key(group, changed, policy.calibration))
    return PaintQuestion(
        group,
        changed,
        _media(changed),
        policy.calibration,
        start=start or calibrate_clicks(group, changed, policy.calibration),
    )


def proposal_question(store: Store, view_id: int) -> PaintQuestion:
    """What to ask about a view without lines, with what its match knows.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
    """
    with store.read() as session:
        stored, view = _find(session, view_id)
        known = known_cameras(session, stored)
    calibration = stored.policy.calibration
    return PaintQuestion(stored.group, view, _media(view), calibration, known=known)


def _find(session: Session, view_id: int) -> tuple[StoredGroup, View]:
    group_id = group_of_view(session, view_id)
    stored = read_groups(session, [group_id])[group_id]
    key = next(key for key, number in stored.view_ids.items() if number == view_id)
    view = stored.group.view(key)
    assert view is not None
    return stored, view


def _media(view: View) -> Media:
    if view.media is None:
        raise NotFoundError(
            f"view {view.key}: this view has no frame that could be read", hint=NO_FRAME_HINT
        )
    return view.media


def known_cameras(session: Session, stored: StoredGroup) -> tuple[Camera, ...]:
    """Cameras of the main views of the groups of the match that are nearest by their number."""
    ids = groups_of_match(session, stored.dataset_id, stored.group.match)
    near = sorted(ids, key=lambda number: abs(number - stored.id))[:MOST_KNOWN]
    others: Mapping[int, StoredGroup] = read_groups(session, near, extras=False)
    groups = [item.group for item in others.values() if item.id != stored.id]
    known = known_calibrations(session, groups, stored.policy)
    policy = stored.policy.calibration
    found = (known.get(view_key(group, group.views[0], policy)) for group in groups if group.views)
    return tuple(item.camera for item in found if item is not None and item.camera is not None)
