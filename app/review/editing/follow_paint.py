"""Follow paint: with an edit of lines the paint of their view is read again.

Only in groups whose paint was read before: whoever asked for that wants it to follow. Where a frame
cannot be read in time the edit is saved all the same, and the camera is that of the clicks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from dataclasses import replace
from time import monotonic

from app.child import ChildEnded
from app.errors import ReviewError
from app.review.datasets.paint_reading import PaintTask, read_view_paint
from app.slot import leave_slot
from app.soccer.group import Group
from app.soccer.paint_evidence import PaintReading
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import clicks_key, sought_key, wanted_paint
from app.store.frames import Frames

SECONDS = 5.0
"""Longer nobody waits for a frame; it is then read when paint is read again."""


class PaintFollower:
    """Reads the paint of an edited group again, in the processes that make pictures."""

    def __init__(self, frames: Frames):
        self._frames = frames

    def follow(
        self, group: Group, policy: CalibrationPolicy, known: Mapping[str, Calibration]
    ) -> Group:
        """The group with its paint read for the lines that it has now; itself where it was.

        Args:
            group: As it will be.
            policy: Of its dataset, for calibrations.
            known: Calibrations by key.
        """
        tasks = list(_stale(group, policy, known))
        if not tasks:
            return group
        read = dict(self._read(tasks))
        return replace(group, paint={**group.paint, **read}) if read else group

    def _read(self, tasks: list[PaintTask]) -> Iterator[tuple[str, PaintReading]]:
        """By view what was read of those whose picture could be read in time."""
        leave_slot()
        end = monotonic() + SECONDS
        try:
            asked = [
                (task, self._frames.ask_to(task.view.media, read_view_paint, task))
                for task in tasks
            ]
        except ReviewError:
            # As many wait as may.
            return
        for task, waiting in asked:
            try:
                reading = waiting.future.result(max(end - monotonic(), 0.0))
            except (TimeoutError, CancelledError, ChildEnded, ReviewError):
                waiting.leave()
                continue
            if reading is not None:
                yield task.view.key, reading


class WithoutPictures(PaintFollower):
    """Where no picture can be read: ``missed`` says that one would have been.

    A camera of clicks alone would be another answer than the one that is asked for.
    """

    def __init__(self) -> None:
        self.missed = False

    def _read(self, tasks: list[PaintTask]) -> Iterator[tuple[str, PaintReading]]:
        self.missed = True
        return iter(())


def _stale(
    group: Group, policy: CalibrationPolicy, known: Mapping[str, Calibration]
) -> Iterator[PaintTask]:
    """Views whose paint was read for other clicks than they have, or, with that of others, not yet."""
    if policy.source != "paint" or not group.paint:
        return
    for view in group.views:
        reading = wanted_paint(group, view, policy)
        if reading is None and (view.media is None or not view.takes_paint):
            continue
        key = sought_key(group, view, policy)
        clicked = known.get(clicks_key(group, view, policy))
        # Clicks that were seen to make no camera say nowhere where to look.
        is_lost = clicked is not None and clicked.camera is None
        if (reading is None or reading.sought_for != key) and not is_lost:
            alone = replace(group, views=(view,), paint={})
            yield PaintTask(alone, policy, key, clicked, reading)
