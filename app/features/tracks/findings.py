"""Balls that contradict a track, as findings of their groups; they live and go with the track."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.db.json_columns import decompress_json, parse_json_column, translate_shape_errors_to_damage
from app.db.session import Session
from app.db.store import Store
from app.features.findings.queries import UnexplainedBall, replace_unexplained_ball_findings
from app.features.groups.queries import StoredGroup, read_groups
from app.features.queue.refresh_queries import refresh_queue
from app.features.tracks.codec import (
    TrackInputs,
    apply_corrections,
    inputs_from_json,
    patches_from_json,
    track_from_json,
)
from app.features.tracks.queries import (
    GroupForTracking,
    list_track_rows,
    read_groups_by_match,
    read_track_bodies,
)
from app.features.tracks.stored import parse_corrections
from app.features.tracks.stretches import make_view_name, parse_frame_number
from app.tracking.ball_track import BallTrack

BATCH = 200
TRIES = 3
"""How often something is computed beside the write that others change meanwhile, before it is in it."""


@dataclass(frozen=True)
class ContradictingBall:
    """A ball that a track does not explain.

    Attributes:
        frame: Of the stretch.
        view: Name of the camera or recording.
        at: Where it was annotated, pixels.
        place: Where the track is seen, pixels; None in a gap.
        px: How far off it is.
        reason: A sentence.
    """

    frame: int
    view: str
    at: tuple[float, float]
    place: tuple[float, float] | None
    px: float
    reason: str


def find_contradicting_balls(ball: BallTrack, inputs: TrackInputs) -> list[ContradictingBall]:
    """The balls that a track does not explain, in its order."""
    measured, first = inputs.measurements, int(ball.frames[0]) if len(ball.frames) else 0
    found = []
    for item in ball.contradicted:
        row = item.measurement
        frame, at = int(measured.frames[row]), measured.pixels[row].tolist()
        place = ball.position[frame - first][None]
        seen = np.full(2, np.nan)
        if np.isfinite(place).all():
            seen = measured.cameras[row].project(place)[0]
        there = (float(seen[0]), float(seen[1])) if np.isfinite(seen).all() else None
        view = measured.views[row]
        found.append(ContradictingBall(frame, view, (at[0], at[1]), there, item.px, item.reason))
    return found


@dataclass(frozen=True)
class TrackNotices:
    """What tracks say of groups.

    Attributes:
        matches: Of the tracks.
        scope: Ids of the groups that are asked about; None: all of the matches.
        items: What they say; each holds for its group as it was read.
    """

    matches: Collection[str]
    scope: set[int] | None
    items: list[UnexplainedBall]


def refresh_track_notices(store: Store, dataset_id: int, matches: Collection[str]) -> None:
    """Bring what tracks say of groups in step with the tracks of matches; rejected ones say nothing.

    Tracks are read before the write, and again where they changed meanwhile; after a few times during it.
    A ball that was changed since the track was made is passed over: the track does not know it.
    """
    for _ in range(TRIES):
        with store.read() as session:
            before = _read_track_states(session, dataset_id, matches)
            found = _read_notices(session, dataset_id, matches)
        with store.write() as session:
            if _read_track_states(session, dataset_id, matches) == before:
                save_notices(session, dataset_id, found)
                return
    with store.write() as session:
        save_notices(session, dataset_id, _read_notices(session, dataset_id, matches))


def make_track_notices(
    session: Session,
    match: str,
    groups: Mapping[int, GroupForTracking],
    track: tuple[BallTrack, TrackInputs] | None,
) -> TrackNotices:
    """The findings of one track about its groups.

    Args:
        session: Any session.
        match: Of the track.
        groups: Of its frames.
        track: Itself, and what it was computed from; None where it was rejected.
    """
    scope = {group.id for group in groups.values()}
    beside = [] if track is None else find_contradicting_balls(*track)
    return TrackNotices([match], scope, _make_ball_notices(session, beside, groups))


def save_notices(session: Session, dataset_id: int, found: TrackNotices) -> None:
    """Store what tracks say of groups, in a write; groups that are no more are passed over."""
    changed = replace_unexplained_ball_findings(
        session, dataset_id, found.matches, found.scope, found.items
    )
    refresh_queue(session, changed)


def _read_track_states(
    session: Session, dataset_id: int, matches: Collection[str]
) -> list[tuple[Any, ...]]:
    """What the findings of tracks depend on beside groups, of which notices say in which state they hold."""
    rows = list_track_rows(session, dataset_id, matches)
    return [(row.id, row.digest, row.revision, row.verdict) for row in rows]


def _read_notices(session: Session, dataset_id: int, matches: Collection[str]) -> TrackNotices:
    groups = read_groups_by_match(session, dataset_id, matches)
    found: list[UnexplainedBall] = []
    for row in list_track_rows(session, dataset_id, groups.keys()):
        if row.verdict == "rejected" or not _count_contradicted(row):
            continue
        body = read_track_bodies(session, [row.id])[row.id]
        inputs = replace(
            inputs_from_json(decompress_json(body.inputs)), corrections=parse_corrections(row)
        )
        patches = () if body.patches is None else patches_from_json(decompress_json(body.patches))
        ball = apply_corrections(inputs, track_from_json(decompress_json(body.body)), patches)
        near = map_groups_by_frame(groups[row.match], row.first, row.last)
        found += _make_ball_notices(session, find_contradicting_balls(ball, inputs), near)
    return TrackNotices(groups.keys(), None, found)


def map_groups_by_frame(
    groups: Iterable[GroupForTracking], first: int, last: int
) -> dict[int, GroupForTracking]:
    """The group of each frame of a stretch that has one."""
    numbered = ((parse_frame_number(group.key), group) for group in groups)
    return {
        frame: group for frame, group in numbered if frame is not None and first <= frame <= last
    }


def _count_contradicted(row: Any) -> int:
    with translate_shape_errors_to_damage():
        return int(parse_json_column(row.summary)["contradicted"])


def _make_ball_notices(
    session: Session, beside: Sequence[ContradictingBall], groups: Mapping[int, GroupForTracking]
) -> list[UnexplainedBall]:
    ids = sorted({groups[item.frame].id for item in beside if item.frame in groups})
    stored: dict[int, StoredGroup] = {}
    for start in range(0, len(ids), BATCH):
        stored |= read_groups(session, ids[start : start + BATCH])
    found = []
    for item in beside:
        group = groups.get(item.frame)
        known = None if group is None else stored.get(group.id)
        key = None if known is None else _find_view_with_ball(known, item)
        if known is not None and key is not None:
            sentence = (
                f"It lies {item.px:.0f} px from the track of the ball over time: "
                "another ball, or a wrong click."
            )
            found.append(
                UnexplainedBall(known.id, key, sentence, item.px, item.place, known.inputs_hash)
            )
    return found


def _find_view_with_ball(stored: StoredGroup, item: ContradictingBall) -> str | None:
    """Key of the view that still shows the ball where the track met it; None: none does."""
    for view in stored.group.views:
        center = None if view.ball is None or not view.included else view.ball.center
        if center is None or make_view_name(view) != item.view:
            continue
        if (center.x, center.y) == item.at:
            return view.key
    return None
