"""Balls of accepted runs for views that are made after the run was accepted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from app.db.session import Session
from app.features.recordings.ball_run_values import (
    ACCEPTING,
    REMOVING,
    StoredRun,
    build_run_from_row,
)
from app.features.recordings.queries import (
    find_ball_run,
    list_ball_run_rows,
    update_ball_run,
)
from app.features.recordings.service import Recording
from app.json_text import canonical_json_text
from app.soccer.annotation import BallAnnotation
from app.soccer.group import Group


class RecordedFrame(NamedTuple):
    """A frame of a recording."""

    recording: Recording
    number: int


class NewGroup(NamedTuple):
    """A group that is about to be stored, and the frames that its new views show, by the keys of the views."""

    group: Group
    frames: Mapping[str, RecordedFrame]


def add_accepted_balls(session: Session, items: Sequence[NewGroup]) -> list[Group]:
    """Groups whose new views have the balls of accepted runs, as if they had been there when those were accepted.

    Runs count these views as ``placed``; in a write.
    """
    shown = {one.recording.id: one.recording for item in items for one in item.frames.values()}
    balls: dict[tuple[int, int], tuple[StoredRun, BallAnnotation]] = {}
    for recording in shown.values():
        for row in list_ball_run_rows(session, recording.id):
            run = build_run_from_row(row, recording.sha256)
            if run.accepted_by is None or run.stale or REMOVING in run.groups:
                continue
            for number, ball in run.trusted_balls.items():
                balls.setdefault((recording.id, number), (run, run.make_annotation(ball)))
    placed = Counter[int]()
    runs = {run.id: run for run, _ in balls.values()}

    def add_balls(item: NewGroup) -> Group:
        views = []
        for view in item.group.views:
            frame = item.frames.get(view.key)
            found = None if frame is None else balls.get((frame.recording.id, frame.number))
            if found is not None:
                placed[found[0].id] += 1
                view = replace(view, balls=(found[1],))
            views.append(view)
        return replace(item.group, views=tuple(views))

    groups = [add_balls(item) for item in items]
    for number, count in placed.items():
        run, row = runs[number], find_ball_run(session, number)
        # One that is being accepted counts what it finds.
        if row is not None and ACCEPTING not in run.groups:
            counts = {**run.groups, "placed": run.groups.get("placed", 0) + count}
            update_ball_run(
                session, number, revision=row.revision + 1, groups=canonical_json_text(counts)
            )
    return groups
