"""Ball runs: one click follows the ball through a shot; a person accepts what came of it, or takes that back."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from app.db.idempotency import without_pending_response
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.service import add_audit_event
from app.features.groups.bulk_edits import ViewEdits, edit_views
from app.features.groups.edit import Edit, SetBalls
from app.features.groups.queries import read_groups
from app.features.groups.state import read_etags, require_etag
from app.features.groups.view_paint import PaintUpdater
from app.features.recordings.ball_run_values import (
    ACCEPTING,
    REMOVING,
    build_run_from_row,
    make_run_etag,
    run_to_columns,
)
from app.features.recordings.ball_run_values import StoredRun as StoredRun
from app.features.recordings.follow import EACH_WAY, BallFollower, collect_follow_hints
from app.features.recordings.queries import (
    delete_ball_run,
    find_ball_run,
    insert_ball_run,
    list_ball_run_rows,
    list_views_of_video,
    update_ball_run,
)
from app.features.recordings.service import Recording, require_recording
from app.features.recordings.shots import get_shots
from app.json_text import canonical_json_text
from app.soccer.annotation import BallAnnotation
from app.tracking.ball_run import BallClick, BallRun

_BATCH = 100


@dataclass(frozen=True)
class BallRunReview:
    """What a person says of a run; what is None stays as it is.

    Attributes:
        accepted: Whether it is accepted.
        confirmed: All uncertain frames that are right.
    """

    accepted: bool | None = None
    confirmed: tuple[int, ...] | None = None


def list_ball_runs(store: Store, recording_id: int) -> list[StoredRun]:
    """The runs of a recording, by their first frames.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        sha256 = require_recording(session, recording_id).sha256
        return [
            build_run_from_row(row, sha256) for row in list_ball_run_rows(session, recording_id)
        ]


def get_ball_run(store: Store, recording_id: int, run_id: int) -> StoredRun:
    """A run of a recording.

    Raises:
        NotFoundError: The recording has no such run.
    """
    with store.read() as session:
        return _require_ball_run(session, recording_id, run_id)


def _require_ball_run(session: Session, recording_id: int, run_id: int) -> StoredRun:
    row = find_ball_run(session, run_id)
    if row is None or row.recording_id != recording_id:
        raise NotFoundError(f"recording {recording_id} has no ball run {run_id}")
    return build_run_from_row(row, require_recording(session, recording_id).sha256)


def add_ball_run(
    store: Store, follower: BallFollower, recording_id: int, click: BallClick, *, actor: str
) -> StoredRun:
    """Follow a ball from a click, and keep what came of it.

    Args:
        store: The database.
        follower: Does the work.
        recording_id: Which recording.
        click: Where the ball is.
        actor: Who clicked.

    Raises:
        ConflictError: The recording cannot be read.
        InputError: The frame is outside of the recording, or nothing near the click looks like a ball.
    """
    with follower.mark_frame_being_followed(recording_id, click.frame):
        recording, run = _follow_click(store, follower, recording_id, click)
        return _save_new_run(store, recording, run, actor)


def _save_new_run(store: Store, recording: Recording, run: BallRun, actor: str) -> StoredRun:
    """Keep a new run."""
    with store.write() as session:
        number = insert_ball_run(
            session,
            actor,
            dataset_id=recording.dataset_id,
            recording_id=recording.id,
            sha256=recording.sha256,
            **run_to_columns(run),
        )
        found = _require_ball_run(session, recording.id, number)
        _log_run_event(session, actor, "ball followed", found)
        session.respond(found)
    return found


def extend_ball_run(
    store: Store,
    follower: BallFollower,
    recording_id: int,
    run_id: int,
    click: BallClick,
    if_match: str,
    *,
    actor: str,
) -> StoredRun:
    """Say where the ball is in one more frame of a run, and follow it from there, too.

    Raises:
        ConflictError, InputError: As ``add_ball_run``; or the run is accepted.
        StaleRevisionError: Somebody changed it meanwhile.
    """
    before = get_ball_run(store, recording_id, run_id)
    _require_unaccepted_and_unchanged(before, if_match)
    with follower.mark_frame_being_followed(recording_id, click.frame):
        _, new = _follow_click(store, follower, recording_id, click, before.run)
        return _save_extended_run(store, before, new, if_match, actor)


def _save_extended_run(
    store: Store, before: StoredRun, new: BallRun, if_match: str, actor: str
) -> StoredRun:
    """Keep a run with what one more click was followed to."""
    recording_id, run_id = before.recording, before.id
    with store.write() as session:
        before = _require_ball_run(session, recording_id, run_id)
        _require_unaccepted_and_unchanged(before, if_match)
        run = before.run.merge_run(new)
        kept = [frame for frame in before.confirmed if frame in {ball.frame for ball in run.balls}]
        values = {**run_to_columns(run), "confirmed": canonical_json_text(kept)}
        found = _save_run_change(session, before, actor, "ball followed anew", **values)
        session.respond(found)
    return found


def review_ball_run(
    store: Store,
    recording_id: int,
    run_id: int,
    change: BallRunReview,
    if_match: str,
    *,
    actor: str,
    paint: PaintUpdater | None = None,
) -> StoredRun:
    """Confirm uncertain frames of a run, accept it, or take that back.

    Accepted, each view that shows one of its frames gets the ball, unless somebody said another one; taken back,
    those balls go, and no others, also where the video is another one by now. It is accepted from before the first
    ball is set until the last one is gone: where a view that has its ball cannot be edited it stays accepted.

    Raises:
        ConflictError: It is accepted, and of another video; or what is confirmed of an accepted run would change.
        InputError: Nothing is changed, or a frame is none of its uncertain ones.
        NotFoundError: The recording has no such run.
        StaleRevisionError: Somebody changed it meanwhile.
    """
    if change.accepted is None and change.confirmed is None:
        raise InputError("this request changes nothing", hint="Send accepted or confirmed.")
    if change.accepted is None:
        with store.write() as session:
            run = _save_confirmed_frames(session, recording_id, run_id, change, if_match, actor)
            session.respond(run)
        return run
    with store.write() as session, without_pending_response():
        run = _reserve_review(session, recording_id, run_id, change, if_match, actor)
    with without_pending_response():
        counts = _apply_run_to_views(store, run, change.accepted, actor, paint)
    with store.write() as session:
        present = _require_ball_run(session, recording_id, run_id)
        if present.etag == run.etag:
            if change.accepted or counts["refused"]:
                found = _update_run(session, run, groups=canonical_json_text(counts))
            else:
                did, values = "ball run acceptance undone", {"accepted_by": None, "groups": "{}"}
                found = _save_run_change(session, run, actor, did, **values)
            session.respond(found)
            return found
        if change.accepted and present.accepted_by == actor:
            # The same request, sent again, has finished it.
            session.respond(present)
            return present
    if change.accepted and present.accepted_by is None:
        # Somebody took it back while its balls were set: they may have missed the last ones.
        with without_pending_response():
            _apply_run_to_views(store, run, False, actor, paint)
    require_etag(present.etag, run.etag, "this ball run")
    return present


def _reserve_review(
    session: Session,
    recording_id: int,
    run_id: int,
    change: BallRunReview,
    if_match: str,
    actor: str,
) -> StoredRun:
    """A run as it is while its balls are set or taken away, which takes seconds: accepted, and of a new revision, so
    that what others do then to the run that they see is refused. What a server did not finish, the same request does.
    """
    run = _require_ball_run(session, recording_id, run_id)
    doing = ACCEPTING if change.accepted else REMOVING
    begun = run.groups.get(doing)
    is_mine = not change.accepted or run.accepted_by == actor
    if begun is not None and is_mine and make_run_etag(run.id, begun, run.created) == if_match:
        return run
    require_etag(run.etag, if_match, "this ball run")
    before = find_ball_run(session, run_id)
    assert before is not None
    if change.accepted and run.stale:
        raise ConflictError(
            "the video file has changed since the ball was followed", hint="Follow the ball again."
        )
    if change.confirmed is not None:
        run = _save_confirmed_frames(session, recording_id, run_id, change, if_match, actor)
    if change.accepted:
        values = {"accepted_by": actor, "groups": canonical_json_text({doing: before.revision})}
        return _save_run_change(session, run, actor, "ball run accepted", **values)
    groups = {**run.groups, doing: before.revision}
    return _update_run(session, run, groups=canonical_json_text(groups))


def _save_confirmed_frames(
    session: Session,
    recording_id: int,
    run_id: int,
    change: BallRunReview,
    if_match: str,
    actor: str,
) -> StoredRun:
    """Keep which uncertain frames a person said are right."""
    run = _require_ball_run(session, recording_id, run_id)
    _require_unaccepted_and_unchanged(run, if_match)
    text = canonical_json_text(_validate_uncertain_frames(run, change.confirmed or ()))
    return _save_run_change(session, run, actor, "ball confirmed", confirmed=text)


def remove_ball_run(store: Store, recording_id: int, run_id: int, *, actor: str) -> None:
    """Delete a run; balls that groups have from it stay.

    Raises:
        NotFoundError: The recording has no such run.
    """
    with store.write() as session:
        found = _require_ball_run(session, recording_id, run_id)
        delete_ball_run(session, run_id)
        _log_run_event(session, actor, "ball run removed", found)
        session.respond(None)


def _follow_click(
    store: Store,
    follower: BallFollower,
    recording_id: int,
    click: BallClick,
    mended: BallRun | None = None,
) -> tuple[Recording, BallRun]:
    """A recording, and what a click in it is followed to; ``mended`` is the run of the same ball so far."""
    shots = get_shots(store, recording_id)
    recording = shots.recording
    recording.require_readable()
    last = (recording.frames or 0) - 1
    if not 0 <= click.frame <= last:
        raise InputError(
            f'"{recording.name}" has no frame {click.frame}; its last one is {last}',
            pointer="/frame",
        )
    inside = (one for one in shots.items if one.first <= click.frame <= one.last)
    shot = next(((one.first, one.last) for one in inside), (click.frame, click.frame))
    around = range(max(shot[0], click.frame - EACH_WAY), min(shot[1], click.frame + EACH_WAY) + 1)
    hints = collect_follow_hints(store, recording, around)
    if mended is not None:
        hints = replace(hints, seen=mended.find_most_certain_click(), clicks=mended.clicks)
    run = follower.follow(recording, click, shot, hints)
    if run is None:
        raise InputError(
            f"nothing near ({click.x:.0f}, {click.y:.0f}) in frame {click.frame} looks like a ball",
            hint="Click its middle, in a frame where it is not hidden.",
        )
    return recording, run


def _apply_run_to_views(
    store: Store,
    run: StoredRun,
    accepted: bool,
    actor: str,
    paint: PaintUpdater | None,
    frames: Collection[int] | None = None,
) -> dict[str, int]:
    """Give the views of a run's frames, or of some of them, its balls, or take those away that come from it; returns
    ``StoredRun.groups`` as they are then if the run is accepted."""
    trusted, items = run.trusted_balls, list[ViewEdits]()
    counts = {"placed": 0, "kept": 0, "refused": 0}
    with store.read() as session:
        # The file may have been replaced since; views keep the video that the run is of.
        shown = list_views_of_video(session, run.dataset_id, run.sha256)
        shown = [
            view
            for view in shown
            if view.number in trusted and (frames is None or view.number in frames)
        ]
        ids = sorted({view.group for view in shown})
        for start in range(0, len(ids), _BATCH):
            some = ids[start : start + _BATCH]
            groups, etags = read_groups(session, some), read_etags(session, some)
            for view in shown:
                if view.group not in groups:
                    continue
                balls = next(
                    one.balls for one in groups[view.group].group.views if one.key == view.key
                )
                mine = run.make_annotation(trusted[view.number])
                if frames is not None and accepted and balls == (mine,):
                    # Another view of this frame was there before.
                    continue
                if accepted and balls and balls != (mine,):
                    counts["kept"] += 1
                    continue
                if not accepted and balls != (mine,):
                    continue
                change = partial(_make_set_balls_edit, balls=(mine,) if accepted else ())
                number = groups[view.group].view_ids[view.key]
                items.append(ViewEdits(number, None, etags[view.group], change))
    report = edit_views(store, run.dataset_id, items, actor=actor, paint=paint)
    for item in report.items:
        counts["refused" if item.outcome == "refused" else "placed"] += 1
    if not accepted:
        counts = {**counts, "placed": counts["refused"], "kept": run.groups.get("kept", 0)}
    return counts


def give_accepted_balls(store: Store, frames: Sequence[tuple[int, int]], actor: str) -> None:
    """Give views that were made after runs were accepted their balls, as accepting them does.

    Args:
        store: The database.
        frames: That the views show: the recording's id and the number.
        actor: Who made the views.
    """
    for recording in sorted({recording for recording, _ in frames}):
        numbers = {number for one, number in frames if one == recording}
        with store.read() as session:
            sha256 = require_recording(session, recording).sha256
            found = [
                build_run_from_row(row, sha256)
                for row in list_ball_run_rows(session, recording)
                if row.accepted_by is not None
            ]
        for run in found:
            mine = numbers & {*run.trusted_balls}
            if run.stale or {ACCEPTING, REMOVING} & {*run.groups} or not mine:
                continue
            counts = _apply_run_to_views(store, run, True, actor, None, mine)
            with store.write() as session:
                row = find_ball_run(session, run.id)
                is_accepted = row is not None and row.accepted_by is not None
                if is_accepted:
                    # No other revision: whoever sees the run may take it back.
                    sums = {name: run.groups.get(name, 0) + count for name, count in counts.items()}
                    update_ball_run(session, run.id, groups=canonical_json_text(sums))
            if row is not None and not is_accepted:
                _apply_run_to_views(store, run, False, actor, None, mine)


def _make_set_balls_edit(view: str, balls: tuple[BallAnnotation, ...]) -> Sequence[Edit]:
    return [SetBalls(view, balls)]


def _require_unaccepted_and_unchanged(run: StoredRun, if_match: str) -> None:
    require_etag(run.etag, if_match, "this ball run")
    if run.accepted_by is not None:
        raise ConflictError(
            "this ball run is accepted, so it cannot be changed", hint="Undo the acceptance first."
        )


def _validate_uncertain_frames(run: StoredRun, frames: Sequence[int]) -> list[int]:
    uncertain = {ball.frame for ball in run.run.balls if ball.state == "uncertain"}
    for place, frame in enumerate(frames):
        if frame not in uncertain:
            raise InputError(
                f"frame {frame} is not an uncertain frame of this ball run",
                pointer=f"/confirmed/{place}",
            )
    return sorted(set(frames))


def _save_run_change(
    session: Session, run: StoredRun, actor: str, did: str, **values: Any
) -> StoredRun:
    changed = _update_run(session, run, **values)
    _log_run_event(session, actor, did, run)
    return changed


def _update_run(session: Session, run: StoredRun, **values: Any) -> StoredRun:
    row = find_ball_run(session, run.id)
    assert row is not None
    update_ball_run(session, run.id, revision=row.revision + 1, **values)
    return _require_ball_run(session, run.recording, run.id)


def _log_run_event(session: Session, actor: str, did: str, run: StoredRun) -> None:
    what = {"recording": run.recording, "run": run.id, "first": run.run.first, "last": run.run.last}
    add_audit_event(session, actor, did, run.dataset_id, **what)
