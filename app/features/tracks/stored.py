"""Tracks as they are stored: from a row of the database to a value."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from app.db.json_columns import parse_json_column, translate_shape_errors_to_damage
from app.features.tracks.codec import TRACK_VERSION, corrections_from_json
from app.features.tracks.queries import GroupForTracking, GroupStateForTracking
from app.features.tracks.run_measurements import AcceptedRun, list_run_states
from app.features.tracks.stretches import StoredStretch, find_shot_at_frame, parse_frame_number
from app.soccer.codec import digest_json
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION
from app.tracking.ball_track import BallTrack, EventCorrection, ViewJump
from app.wording import plural

Verdict = Literal["accepted", "rejected"]
UNJUDGED: dict[str, None] = dict.fromkeys(("verdict", "note", "judged_by", "judged_at"))
"""Columns of a track that nobody judged."""


@dataclass(frozen=True)
class TrackSummary:
    """What came of tracking the ball over a stretch.

    Attributes:
        frames: Of the stretch.
        states: Frames by how the ball is known: ``measured`` by two views, ``one_view``, ``predicted``,
            ``bridged`` over a gap, ``gap``.
        events: Events by kind.
        measurements: Balls that views show.
        contradicted: Those that the track does not explain.
        median_px: Median error of balls that were left out in turn and predicted, pixels; None: none was.
        p95_px: 95th percentile of the same.
        worst: The frame where that error is largest.
        reason: Why there is no track; None: there is one.
        rate: Frames a second.
        unused: Balls that were not used, by reason.
        warnings: Sentences: balls that were not used, jumps where other views take over, and runs of balls
            that fit no track.
        noise: Times that balls of a camera are noisier than clicks because it is inexact, by camera.
        late: Seconds to add to the times of a camera, as the ball shows them, by camera.
    """

    frames: int
    states: dict[str, int]
    events: dict[str, int]
    measurements: int
    contradicted: int
    median_px: float | None
    p95_px: float | None
    worst: int | None
    reason: str | None
    rate: float
    unused: dict[str, int]
    warnings: list[str] = field(default_factory=list)
    noise: dict[str, float] = field(default_factory=dict)
    late: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Track:
    """The track of a stretch, without its frames.

    Attributes:
        key: Of the stretch; unique in its dataset.
        match: Of its groups.
        first, last: Its first and last frame.
        stale: Whether its groups have changed since, so that another track would come of them.
        corrections: Events that people added, and removed.
        summary: What came of it.
        revision: How often something was said of it, or it was made anew.
    """

    id: int
    dataset_id: int
    dataset: str
    key: str
    match: str
    first: int
    last: int
    stale: bool
    verdict: Verdict | None
    note: str | None
    judged_by: str | None
    judged_at: str | None
    corrections: tuple[EventCorrection, ...]
    summary: TrackSummary
    actor: str
    created: str
    revision: int
    etag: str


def summarize_track(track: BallTrack, like: TrackSummary) -> TrackSummary:
    """The summary of a track as a list shows it.

    Args:
        track: With its corrections.
        like: Has what the track does not say: measurements, rate, balls that are none.
    """
    left, worst = track.left_out, None
    if left is not None and np.isfinite(left.by_frame).any():
        worst = int(track.frames[np.nanargmax(left.by_frame)])
    kinds = [event.kind for event in track.events]
    told = format_unused_balls(like.unused), format_view_jumps(track.jumps)
    return replace(
        like,
        frames=len(track.frames),
        states={state: track.state.count(state) for state in sorted(set(track.state))},
        events={kind: kinds.count(kind) for kind in sorted(set(kinds))},
        contradicted=len(track.contradicted),
        median_px=None if left is None else left.median_px,
        p95_px=None if left is None else left.p95_px,
        worst=worst,
        reason=track.reason,
        noise=dict(track.noise),
        late=dict(track.offsets),
        warnings=[*filter(None, told), *(item.sentence for item in track.untracked)],
    )


def format_unused_balls(unused: Mapping[str, int]) -> str | None:
    """Which balls took no part, a sentence; None: all did."""
    parts = [f"{plural(count, 'ball')} ({reason})" for reason, count in sorted(unused.items())]
    return f"Not measured: {', '.join(parts)}." if parts else None


def format_view_jumps(jumps: Sequence[ViewJump]) -> str | None:
    """Where views that take over put the ball elsewhere, a sentence; None: nowhere."""
    if not jumps:
        return None
    metres = sorted(jump.metres for jump in jumps)
    return (
        f"The ball jumps where the views change, {plural(len(jumps), 'time')}, by {metres[len(metres) // 2]:.1f} m "
        f"in the median and {metres[-1]:.1f} m at most: their cameras contradict each other there."
    )


def build_track_from_row(
    row: Any,
    policy: Policy,
    groups: Iterable[GroupForTracking | GroupStateForTracking],
    runs: Sequence[AcceptedRun] = (),
    shots: Sequence[tuple[int, int]] | None = None,
) -> Track:
    """A row of the table without what is large, with the groups, accepted ball runs and shots of its match."""
    return Track(
        id=row.id,
        dataset_id=row.dataset_id,
        dataset=row.dataset,
        key=row.key,
        match=row.match,
        first=row.first,
        last=row.last,
        stale=row.stamp != compute_track_stamp(policy, groups, row, runs, shots),
        verdict=row.verdict,
        note=row.note,
        judged_by=row.judged_by,
        judged_at=row.judged_at,
        corrections=parse_corrections(row),
        summary=parse_track_summary(row),
        actor=row.actor,
        created=row.created,
        revision=row.revision,
        etag=make_track_etag(row),
    )


def parse_track_summary(row: Any) -> TrackSummary:
    """The summary of the track of a row, for lists."""
    with translate_shape_errors_to_damage():
        return TrackSummary(**parse_json_column(row.summary))


def make_track_etag(row: Any) -> str:
    """The ETag of a row's track, quoted."""
    return f'"{digest_json([row.digest, row.revision])[:16]}"'


def parse_corrections(row: Any) -> tuple[EventCorrection, ...]:
    """The corrections that people made to the events of the track of a row."""
    with translate_shape_errors_to_damage():
        return corrections_from_json(parse_json_column(row.corrections))


def compute_track_stamp(
    policy: Policy,
    groups: Iterable[GroupForTracking | GroupStateForTracking],
    place: StoredStretch,
    runs: Sequence[AcceptedRun] = (),
    shots: Sequence[tuple[int, int]] | None = None,
) -> str:
    """A digest of what a stretch's track depends on, without computing it.

    Args:
        policy: Of the dataset.
        groups: Of the match.
        place: The stretch: of a rig all groups of the match, of a recording those of its shot, or of its frames
            where no shot is known.
        runs: Accepted ball runs that show the ball of the match.
        shots: First and last frames of the shots of the match, where it is a recording.
    """
    whole = place.key == place.match
    first, last = find_shot_at_frame(place.first, shots) or (place.first, place.last)
    states = [
        [group.key, *group.state]
        for group in groups
        if (frame := parse_frame_number(group.key)) is not None
        and (whole or first <= frame <= last)
    ]
    followed = list_run_states(runs, first, last)
    said = [followed] if followed else []
    return digest_json([TRACK_VERSION, SOLVER_VERSION, policy.hash, states, *said])
