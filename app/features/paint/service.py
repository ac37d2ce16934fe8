"""Paint: what is read of the paint in a dataset's pictures, given to its groups, and taken back.

It is read when somebody asks for it, in processes of their own, and is data of the group from then
on: ``solve`` needs no picture. Views whose picture was read for the clicks that they have now are
left alone. A run can be killed anywhere; the next one goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, ImageError, TooLargeError
from app.features.datasets.queries import list_group_ids
from app.features.datasets.service import (
    DatasetHead,
    require_dataset_id,
    require_dataset_with_matches,
)
from app.features.groups.edit import SetPaintReadings
from app.features.groups.group_edits import edit_groups
from app.features.groups.pictures import (
    PaintTask,
    PictureTask,
    mark_readings_with_stale_people_boxes,
    read_view_paint,
)
from app.features.groups.queries import StoredGroup, read_groups
from app.features.jobs.queries import Job
from app.features.paint.queries import (
    PAINT,
    MatchPaintCounts,
    count_paint_by_match,
    find_last_paint_run_entries,
    insert_paint_readings,
    read_paint_readings,
)
from app.features.paint.tripod import solve_match_tripods
from app.features.solutions.service import read_known_calibrations
from app.media.frames import VideoIndexer
from app.progress import ReportProgress
from app.soccer.paint_evidence import NO_FRAME, NO_PAINT, PAINT_DISAGREES, PaintReading
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import compute_click_calibration_key, compute_paint_search_key
from app.worker_pool import WorkerPool
from app.worker_process import COUNTS, WorkerLimits

LIMITS = WorkerLimits(memory=2 * 2**30, processor=60.0, silence=180.0)
"""For one picture; the first one of a process may have to wait for kernels to be compiled."""
_PER_WORKER = 6
"""Groups that each worker gets before they are written."""
_BATCH = 100
MOST_COMPARED = 1000
"""Groups with paint whose lines are compared with those that it was read for, when somebody asks
how a dataset stands; a reading compares all."""


@dataclass(frozen=True)
class MatchPaintSummary:
    """What was read of the pictures of one match.

    Attributes:
        match: Name of the match.
        groups: How many it has.
        views: Views of moving cameras with lines.
        without_picture: How many of them have no picture.
        read: How many were read.
        old: How many were read for other lines or beside other people than they have, or by an
            older extractor; None: too many were read to compare them. Whether a picture is still the same only reading says.
        painted: How many of those have a camera from their paint, as far as the lines are still
            those that it was read for.
        no_paint: How many show too little of it.
        paint_disagrees: In how many it does not lie where the lines were drawn.
        no_frame: How many have no picture that can be read.
        sentence: All that in words.
    """

    match: str
    groups: int
    views: int
    without_picture: int
    read: int
    old: int | None
    painted: int
    no_paint: int
    paint_disagrees: int
    no_frame: int
    sentence: str = ""


@dataclass(frozen=True)
class DatasetPaint:
    """What was read of a dataset's pictures; ``used``: whether its policy uses it."""

    dataset_id: int
    dataset: str
    used: bool
    items: tuple[MatchPaintSummary, ...]


def summarize_paint_readings(store: Store, dataset: str | int) -> DatasetPaint:
    """The counts of paint readings of a dataset, by match.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        found = require_dataset_with_matches(session, dataset)
        matches = count_paint_by_match(session, found.id)
        old = _count_outdated_readings(session, found, matches)
    items = tuple(
        _make_paint_state(item, None if old is None else old[item.match]) for item in matches
    )
    return DatasetPaint(found.id, found.name, found.policy.calibration.source == "paint", items)


def read_paint_of_pictures(
    store: Store,
    dataset: str | int,
    matches: Collection[str] | None = None,
    *,
    actor: str,
    run: str | None = None,
    workers: int | None = None,
    progress: ReportProgress | None = None,
    require_wanted: Callable[[], None] | None = None,
) -> DatasetPaint:
    """Read the paint of pictures and give it to their groups; stale until solved.

    Views whose picture was read for the same lines before, and is the same, are left alone.

    Args:
        store: The database.
        dataset: Name or id.
        matches: By name; None: all.
        actor: Who wants it.
        run: Name of this reading, by which it is taken back; None: the time.
        workers: How many pictures are read at once; None: as the settings say.
        progress: Called with groups done and in all; an error that it raises ends the run.
        require_wanted: Called in each transaction that gives something, before it does; what is
            not wanted any more it stops with an error.

    Raises:
        ConflictError: The dataset's policy does not use paint.
        NotFoundError: There is no such dataset or match.
        OverloadedError: Processes were killed over one picture, twice; what was read stays.
    """
    found = require_paint_in_use(store, dataset, matches)
    with store.read() as session:
        ids = list_group_ids(session, found.id, matches)
    run, count, done = run or now(), workers or store.settings.image_workers, 0
    with (
        closing(VideoIndexer(store.settings)) as videos,
        closing(WorkerPool(LIMITS, count, 0, "pictures", COUNTS["paint"])) as pool,
    ):
        for start in range(0, len(ids), _PER_WORKER * count):
            some = ids[start : start + _PER_WORKER * count]
            tasks = _make_tasks(store, some, found)
            views = [task.view.media for of_group in tasks.values() for task in of_group]
            videos.index_videos(views, done, len(ids), progress)
            readings = _read_paint_of_pictures(store, pool, videos, tasks)
            with store.write() as session:
                if require_wanted is not None:
                    require_wanted()
                _save_reading_edits(session, found.id, readings, actor, {"run": run})
            done += len(some)
            if progress is not None:
                progress(done, len(ids))
    solve_match_tripods(store, found, matches, actor, run, require_wanted)
    return summarize_paint_readings(store, found.id)


def require_paint_in_use(
    store: Store, dataset: str | int, matches: Collection[str] | None = None
) -> DatasetHead:
    """The dataset, unless nothing would use what is read.

    Raises:
        ConflictError: The dataset's policy does not use paint.
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        found = require_dataset_with_matches(session, dataset, matches)
    if found.policy.calibration.source != "paint":
        raise ConflictError(
            f'the policy of "{found.name}" does not use the paint in pictures',
            hint="Choose the policy touchline, or set calibration.source to paint, first.",
        )
    return found


def undo_paint_reading(
    session: Session,
    dataset: str | int,
    _match: str | None = None,
    *,
    actor: str,
    stopped: Sequence[Job] = (),
) -> None:
    """Give the groups of a dataset what they had before paint was read last.

    Once more takes back the reading before that one.

    Args:
        session: A write session.
        dataset: Name or id.
        actor: Who wants it.
        stopped: Readings that were stopped for it: the last of those is taken back as far as it
            came, and where none came to anything no earlier one is.

    Raises:
        ConflictError: Nothing was read, or all of it is taken back.
        NotFoundError: There is no such dataset.
    """
    found = require_dataset_with_matches(session, dataset)
    entries = find_last_paint_run_entries(session, found.id)
    stopped_runs = {job.request["run"] for job in stopped}
    if stopped and not (entries and entries[0].body["run"] in stopped_runs):
        return
    if not entries:
        raise ConflictError(
            f'no picture of "{found.name}" has a measurement of its paint, so there is nothing'
            " to undo"
        )
    before: dict[int, Mapping[str, str]] = {}
    for entry in entries:
        # A run that was begun again may have given a group something twice.
        before.setdefault(entry.group_id or 0, entry.body["inverse"]["paint"])
    named = {digest for paint in before.values() for digest in paint.values()}
    known = read_paint_readings(session, named)
    wanted = {
        number: {view: known[digest] for view, digest in paint.items()}
        for number, paint in before.items()
    }
    run = entries[0].body["run"]
    _save_reading_edits(session, found.id, wanted, actor, {"run": f"{run} back", "takes_back": run})


def _save_reading_edits(
    session: Session,
    dataset_id: int,
    wanted: Mapping[int, Mapping[str, PaintReading]],
    actor: str,
    body: dict[str, Any],
) -> None:
    """One entry for each group that changes; of a take-back for the first in any case."""
    ids = sorted(wanted)

    def make_paint_edits(some: Mapping[int, StoredGroup]) -> dict[int, SetPaintReadings]:
        fitting = {
            number: SetPaintReadings(
                mark_readings_with_stale_people_boxes(stored.group, wanted[number])
            ).apply(stored.group)
            for number, stored in some.items()
        }
        for group in fitting.values():
            insert_paint_readings(session, dataset_id, group.paint.values())
        return {number: SetPaintReadings(group.paint) for number, group in fitting.items()}

    always_logged = ids[0] if ids and "takes_back" in body else None
    edit_groups(
        session,
        dataset_id,
        PAINT,
        ids,
        make_paint_edits,
        actor=actor,
        body=body,
        always_logged=always_logged,
    )


def _make_tasks(
    store: Store, ids: Sequence[int], dataset: DatasetHead
) -> dict[int, list[PaintTask]]:
    """What is to be read for each group; groups without a view that takes paint have none."""
    with store.read() as session:
        stored = read_groups(session, ids)
        of_lines = replace(dataset.policy.calibration, source="lines")
        clicks = replace(dataset.policy, calibration=of_lines)
        known = read_known_calibrations(session, [item.group for item in stored.values()], clicks)
    return {
        number: list(_make_group_tasks(item, dataset.policy.calibration, known))
        for number, item in stored.items()
    }


def _make_group_tasks(
    stored: StoredGroup, policy: CalibrationPolicy, known: Mapping[str, Any]
) -> Iterator[PaintTask]:
    group = stored.group
    for view in group.views:
        if view.can_use_paint:
            clicked = known.get(compute_click_calibration_key(group, view, policy))
            alone = replace(group, views=(view,), paint={})
            key, old = compute_paint_search_key(group, view, policy), group.paint.get(view.key)
            yield PaintTask(alone, policy, key, clicked, old)


def _read_paint_of_pictures(
    store: Store,
    pool: WorkerPool,
    videos: VideoIndexer,
    tasks: Mapping[int, Sequence[PaintTask]],
) -> dict[int, dict[str, PaintReading]]:
    """What was read for each group, by view; views without a camera of their clicks are left out."""

    def submit_task(task: PaintTask) -> PictureTask:
        work = (read_view_paint, task, store.settings)
        media = task.view.media
        return PictureTask(
            pool, *(work if media is None else videos.make_worker_call(media, *work))
        )

    futures = {
        number: [(task, submit_task(task)) for task in some] for number, some in tasks.items()
    }
    return {
        number: {
            task.view.key: reading
            for task, reads in some
            if (reading := _wait_for_reading(task, reads)) is not None
        }
        for number, some in futures.items()
    }


def _wait_for_reading(task: PaintTask, reads: PictureTask) -> PaintReading | None:
    try:
        reading: PaintReading | None = reads.result()
    except (ImageError, TooLargeError):
        # Its process ended over it: to this service that picture is unreadable.
        return task.reusable_reading or task.make_reading_without_frame
    return reading


def has_pictures_to_read_paint_from(store: Store, dataset: str | int) -> bool:
    """Whether there is a picture whose paint could be read.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        number = require_dataset_id(session, dataset)
        return any(
            item.views > item.without_picture for item in count_paint_by_match(session, number)
        )


def _count_outdated_readings(
    session: Session, dataset: DatasetHead, matches: Sequence[MatchPaintCounts]
) -> dict[str, int] | None:
    """How many readings of each match do not fit any more; None where they are too many."""
    ids = [number for item in matches for number in item.painted]
    if len(ids) > MOST_COMPARED:
        return None
    old = {item.match: 0 for item in matches}
    for start in range(0, len(ids), _BATCH):
        some = read_groups(session, ids[start : start + _BATCH])
        for stored in some.values():
            tasks = _make_group_tasks(stored, dataset.policy.calibration, {})
            old[stored.group.match] += sum(task.is_outdated for task in tasks)
    return old


def _make_paint_state(item: MatchPaintCounts, old: int | None) -> MatchPaintSummary:
    found = MatchPaintSummary(
        match=item.match,
        groups=len(item.groups),
        views=item.views,
        without_picture=item.without_picture,
        read=sum(item.reasons.values()),
        old=old,
        painted=item.reasons.get(None, 0),
        no_paint=item.reasons.get(NO_PAINT, 0),
        paint_disagrees=item.reasons.get(PAINT_DISAGREES, 0),
        no_frame=item.reasons.get(NO_FRAME, 0),
    )
    return replace(found, sentence=_describe_state(found))


def _describe_state(state: MatchPaintSummary) -> str:
    left = max(state.views - state.without_picture, state.read)
    if not left:
        return f"none of {state.views} views has a picture" if state.views else "nothing to read"
    if state.read:
        parts = [f"{state.read} of {left} pictures were read: {state.painted} by their paint"]
    else:
        parts = [f"the paint of none of {left} pictures was read"]
    parts += [
        f"{count} {words}"
        for count, words in (
            (state.no_paint, "with too little paint"),
            (state.paint_disagrees, "with paint that disagrees with the lines"),
            (state.no_frame, "missing or unreadable"),
            (state.old, "to be read again"),
        )
        if count
    ]
    if state.without_picture:
        parts.append(f"{state.without_picture} without a picture")
    return ", ".join(parts)
