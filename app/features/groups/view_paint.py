"""Painted lines of one view's frame, read on request and after an edit of its lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass, field, replace
from time import monotonic

import numpy as np

from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError, ReviewError
from app.features.groups.edit import LineChanges, SetLines
from app.features.groups.edit_codec import require_point_limits_of_edits
from app.features.groups.pictures import PaintTask, read_view_paint
from app.features.groups.queries import StoredGroup, find_group_of_view, read_groups
from app.features.pitches.queries import list_groups_of_match
from app.features.solutions.service import read_known_calibrations
from app.geometry.camera import Camera
from app.geometry.lens import BROWN_CONRADY
from app.media.frames import FrameProvider
from app.paint.view_paint import read_paint
from app.paint.view_proposal import propose_undrawn_lines
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, View
from app.soccer.paint_evidence import PaintReading
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import (
    calibrate_from_clicks,
    compute_click_calibration_key,
    compute_paint_search_key,
    compute_view_calibration_key,
    find_wanted_paint_reading,
)
from app.solving.observations import principal_point
from app.worker_pool import PoolTask
from app.worker_process import WorkerEnded

MOST_KNOWN = 12
"""Groups of a match whose cameras say where to look first; one stand needs no more."""
PLAIN_SHARE = 0.01
"""Of the diagonal a lens centre may lie off the middle, and of its size a pixel be too wide."""
NO_FRAME_HINT = "The report of the import gives the reason. Correct the files and import them again to attach the frames."


@dataclass(frozen=True)
class ViewPaintRequest:
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

    def request_paint(self, frames: FrameProvider) -> PoolTask:
        """Have the paint read near the camera; the result is a ``ViewPaint``."""
        station = self.view.station
        return frames.request_work_on_frame(
            self.media, station.flipped, read_paint,
            station.size, self.start, self.group.pitch, self.policy, self.view.extras.pixel_boxes,
        )  # fmt: skip

    def request_proposal(self, frames: FrameProvider) -> PoolTask:
        """Have lines proposed; the result is a ``ViewProposal``."""
        station = self.view.station
        return frames.request_work_on_frame(
            self.media, station.flipped, propose_undrawn_lines,
            station.size, self.known, self.group.pitch, self.policy, self.drawn,
        )  # fmt: skip


def make_paint_request(store: Store, view_id: int, lines: LineChanges) -> ViewPaintRequest:
    """What to ask about a view whose lines are changed like this, unsaved.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
        InputError: The lines say something impossible.
    """
    with store.read() as session:
        return _make_request(session, view_id, lines)


def make_proposal_request(store: Store, view_id: int, lines: LineChanges) -> ViewPaintRequest:
    """What to ask about a view whose lines are changed like this, with what its match knows.

    What is drawn stays also where it determines a camera already: whoever asks may not know yet.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
        InputError: The lines say something impossible.
    """
    with store.read() as session:
        question = _make_request(session, view_id, lines)
        known = list_cameras_of_nearest_groups(session, _find_group_and_view(session, view_id)[0])
    return replace(question, known=known, drawn=question.view.station.lines)


def _make_request(session: Session, view_id: int, lines: LineChanges) -> ViewPaintRequest:
    stored, view = _find_group_and_view(session, view_id)
    edit = SetLines(view.key, lines)
    require_point_limits_of_edits(stored.group, [edit])
    group, policy = edit.apply(stored.group), stored.policy
    known = read_known_calibrations(session, [group], policy)
    changed = next(item for item in group.views if item.key == view.key)
    # What the lines alone make: what was read of the paint before has no part in what is read.
    start = known.get(compute_click_calibration_key(group, changed, policy.calibration))
    return ViewPaintRequest(
        group,
        changed,
        _require_media(changed),
        policy.calibration,
        start=start or calibrate_from_clicks(group, changed, policy.calibration),
    )


def _find_group_and_view(session: Session, view_id: int) -> tuple[StoredGroup, View]:
    group_id = find_group_of_view(session, view_id)
    stored = read_groups(session, [group_id])[group_id]
    key = next(key for key, number in stored.view_ids.items() if number == view_id)
    view = stored.group.view(key)
    assert view is not None
    return stored, view


def _require_media(view: View) -> Media:
    if view.media is None:
        raise NotFoundError(f"view {view.key}: this view has no readable frame", hint=NO_FRAME_HINT)
    return view.media


def list_cameras_of_nearest_groups(session: Session, stored: StoredGroup) -> tuple[Camera, ...]:
    """Cameras of the main views of the groups of the match that are nearest by their number.

    Those that their lines leave open say nothing of a stand, and lenses of another kind nothing
    that the search could take.
    """
    ids = list_groups_of_match(session, stored.dataset_id, stored.group.match)
    near = sorted(ids, key=lambda number: abs(number - stored.id))[:MOST_KNOWN]
    others: Mapping[int, StoredGroup] = read_groups(session, near, extras=False)
    groups = [item.group for item in others.values() if item.id != stored.id]
    known = read_known_calibrations(session, groups, stored.policy)
    policy = stored.policy.calibration
    found = []
    for group in groups:
        for view in group.views[:1]:
            item = known.get(compute_view_calibration_key(group, view, policy))
            if item is not None and item.camera is not None and not item.unobservable:
                found.append((item.camera, view.size))
    return tuple(camera for camera, size in found if _has_plain_lens(camera, size))


def _has_plain_lens(camera: Camera, size: ImageSize) -> bool:
    """Whether a camera has the lens that the search knows: its centre in the middle, square pixels
    and a radial term."""
    off = np.subtract(camera.principal_point, principal_point(size))
    x, y = camera.focal_length
    return bool(
        camera.lens == BROWN_CONRADY
        and np.hypot(*off) <= PLAIN_SHARE * size.diagonal
        and abs(x / y - 1) <= PLAIN_SHARE
    )


SECONDS = 5.0
"""Longer nobody waits for a frame; it is then read when paint is read again."""


class PaintUpdater:
    """Reads the paint of an edited group again, in the processes that make pictures."""

    def __init__(self, frames: FrameProvider):
        self._frames = frames

    def update_paint(
        self, group: Group, policy: CalibrationPolicy, known: Mapping[str, Calibration]
    ) -> Group:
        """The group with its paint read for the lines that it has now; itself where it was.

        Args:
            group: As it will be.
            policy: Of its dataset, for calibrations.
            known: Calibrations by key.
        """
        tasks = list(_iterate_outdated_paint_tasks(group, policy, known))
        if not tasks:
            return group
        read = dict(self._read_pictures(tasks))
        return replace(group, paint={**group.paint, **read}) if read else group

    def _read_pictures(self, tasks: list[PaintTask]) -> Iterator[tuple[str, PaintReading]]:
        """By view what was read of those whose picture could be read in time."""
        end = monotonic() + SECONDS
        try:
            started = [
                (task, self._frames.request_work(task.view.media, read_view_paint, task))
                for task in tasks
            ]
        except ReviewError:
            # As many wait as may.
            return
        for task, waiting in started:
            try:
                reading = waiting.future.result(max(end - monotonic(), 0.0))
            except (TimeoutError, CancelledError, WorkerEnded, ReviewError):
                waiting.abandon()
                continue
            if reading is not None:
                yield task.view.key, reading


class PaintUpdaterWithoutPictures(PaintUpdater):
    """Where no picture can be read: ``missed`` says that one would have been.

    A camera of clicks alone would be another answer than the one that is asked for.
    """

    def __init__(self) -> None:
        self.missed = False

    def _read_pictures(self, tasks: list[PaintTask]) -> Iterator[tuple[str, PaintReading]]:
        self.missed = True
        return iter(())


def _iterate_outdated_paint_tasks(
    group: Group, policy: CalibrationPolicy, known: Mapping[str, Calibration]
) -> Iterator[PaintTask]:
    """Views whose paint was read for other clicks than they have, or, with that of others, not yet."""
    if policy.source != "paint" or not group.paint:
        return
    for view in group.views:
        reading = find_wanted_paint_reading(group, view, policy)
        if reading is None and (view.media is None or not view.can_use_paint):
            continue
        key = compute_paint_search_key(group, view, policy)
        clicked = known.get(compute_click_calibration_key(group, view, policy))
        # Clicks that were seen to make no camera say nowhere where to look.
        is_lost = clicked is not None and clicked.camera is None
        if (reading is None or reading.sought_for != key) and not is_lost:
            alone = replace(group, views=(view,), paint={})
            yield PaintTask(alone, policy, key, clicked, reading)
