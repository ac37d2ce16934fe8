"""View paint: the frame of a view asked for its painted lines; nothing is saved.

Frames are read in the processes that make pictures: what is wrong with one ends there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from app.errors import NotFoundError
from app.geometry.camera import Camera
from app.geometry.lens import BROWN_CONRADY
from app.paint.drawn_lines import propose_beside
from app.paint.view_paint import read_paint
from app.review.editing.edit import LineChanges, SetLines
from app.review.editing.known import known_calibrations
from app.review.editing.point_limits import require_few_points_in_all
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, View
from app.soccer.media import Media
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_clicks, clicks_key, view_key
from app.solving.observations import principal_point
from app.store.frames import Frames
from app.store.groups import StoredGroup, group_of_view, read_groups
from app.store.pitches import groups_of_match
from app.store.session import Session
from app.store.store import Store
from app.worker_pool import PoolTask

MOST_KNOWN = 12
"""Groups of a match whose cameras say where to look first; one stand needs no more."""
PLAIN_SHARE = 0.01
"""Of the diagonal a lens centre may lie off the middle, and of its size a pixel be too wide."""
NO_FRAME_HINT = (
    "The import's report says why; importing again after the files are mended attaches the frames."
)


@dataclass(frozen=True)
class PaintQuestion:
    """A view as its lines are now, and the camera that they make.

    Attributes:
        known: Cameras of other groups of the match; for proposals, as the next.
        drawn: For proposals, the view's lines: they stay, and others are proposed beside them.
    """

    group: Group
    view: View
    media: Media
    policy: CalibrationPolicy
    start: Calibration | None = None
    known: tuple[Camera, ...] = ()
    drawn: Lines = field(default_factory=dict)

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
            self.media, station.flipped, propose_beside,
            station.size, self.known, self.group.pitch, self.policy, self.drawn,
        )  # fmt: skip


def paint_question(store: Store, view_id: int, lines: LineChanges) -> PaintQuestion:
    """What to ask about a view whose lines are changed like this, unsaved.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
        InputError: The lines say something impossible.
    """
    with store.read() as session:
        return _question(session, view_id, lines)


def proposal_question(store: Store, view_id: int, lines: LineChanges) -> PaintQuestion:
    """What to ask about a view whose lines are changed like this, with what its match knows.

    What is drawn stays also where it determines a camera already: whoever asks may not know yet.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
        InputError: The lines say something impossible.
    """
    with store.read() as session:
        question = _question(session, view_id, lines)
        known = known_cameras(session, _find(session, view_id)[0])
    return replace(question, known=known, drawn=question.view.station.lines)


def _question(session: Session, view_id: int, lines: LineChanges) -> PaintQuestion:
    stored, view = _find(session, view_id)
    edit = SetLines(view.key, lines)
    require_few_points_in_all(stored.group, [edit])
    group, policy = edit.apply(stored.group), stored.policy
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
    """Cameras of the main views of the groups of the match that are nearest by their number.

    Those that their lines leave open say nothing of a stand, and lenses of another kind nothing
    that the search could take.
    """
    ids = groups_of_match(session, stored.dataset_id, stored.group.match)
    near = sorted(ids, key=lambda number: abs(number - stored.id))[:MOST_KNOWN]
    others: Mapping[int, StoredGroup] = read_groups(session, near, extras=False)
    groups = [item.group for item in others.values() if item.id != stored.id]
    known = known_calibrations(session, groups, stored.policy)
    policy = stored.policy.calibration
    found = []
    for group in groups:
        for view in group.views[:1]:
            item = known.get(view_key(group, view, policy))
            if item is not None and item.camera is not None and not item.unobservable:
                found.append((item.camera, view.size))
    return tuple(camera for camera, size in found if _is_plain(camera, size))


def _is_plain(camera: Camera, size: ImageSize) -> bool:
    """Whether a camera has the lens that the search knows: its centre in the middle, square pixels
    and a radial term."""
    off = np.subtract(camera.principal_point, principal_point(size))
    x, y = camera.focal_length
    return bool(
        camera.lens == BROWN_CONRADY
        and np.hypot(*off) <= PLAIN_SHARE * size.diagonal
        and abs(x / y - 1) <= PLAIN_SHARE
    )
