"""Proposals of a dataset: cameras for views that have none, as predictions that nobody said yet.

They are kept beside the groups and no solve reads them. A person accepts one as lines, an edit
like any other whose source is ``proposed``. A run can be killed anywhere; the next one leaves
alone what was looked at, and goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

from app.db.store import Store
from app.errors import ImageError, NotFoundError, TooLargeError
from app.features.datasets.service import (
    DatasetHead,
    require_dataset_id,
    require_dataset_with_matches,
)
from app.features.groups.pictures import (
    UNREADABLE,
    PictureTask,
    ProposalTask,
    propose_lines_for_task,
)
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.state import read_group_change_basis
from app.features.groups.view_paint import list_cameras_of_nearest_groups
from app.features.paint.proposal_queries import (
    MatchProposalCounts,
    count_proposals_by_match,
    delete_proposals,
    list_views_to_propose_for,
    read_group_proposals,
    read_proposals,
    save_proposals,
)
from app.features.paint.proposal_queries import Proposal as Proposal
from app.media.frames import VideoIndexer
from app.paint.propose import SEARCH_VERSION
from app.progress import ReportProgress
from app.soccer.codec import camera_to_json, digest_json, station_digest
from app.worker_pool import WorkerPool
from app.worker_process import COUNTS, WorkerLimits

LIMITS = WorkerLimits(memory=2 * 2**30, processor=120.0, silence=240.0)
"""For one picture; the first one of a process may have to wait for kernels to be compiled."""
_PER_WORKER = 4
"""Groups that each worker gets before they are written."""


@dataclass(frozen=True)
class DatasetProposalCounts:
    """What was proposed for a dataset's views, by match."""

    dataset_id: int
    dataset: str
    items: tuple[MatchProposalCounts, ...]

    def sum_counts(self, name: str) -> int:
        """Sum of a count over the matches."""
        return sum(getattr(item, name) for item in self.items)


@dataclass(frozen=True)
class ProposalRunReport:
    """What one run did.

    Attributes:
        views: Views without a camera, given or of their lines, that have a picture on record.
        left: Whose proposal still stood.
        proposed, unsure, nothing: What became of the others.
        changed: Whose picture is another one than when it was looked at before.
        missing: Whose picture is missing or cannot be read; they are among ``nothing``.
    """

    views: int = 0
    left: int = 0
    proposed: int = 0
    unsure: int = 0
    nothing: int = 0
    changed: int = 0
    missing: int = 0

    def add_view(self, task: ProposalTask, found: Proposal | None) -> ProposalRunReport:
        """With one view more."""
        if found is None:
            return replace(self, views=self.views + 1, left=self.left + 1)
        before = "" if task.old is None else task.old.frame
        return replace(
            self,
            views=self.views + 1,
            **{found.outcome: getattr(self, found.outcome) + 1},
            changed=self.changed + (before not in ("", found.frame) and found.frame != ""),
            missing=self.missing + (found.frame == ""),
        )


def get_proposal_counts(
    store: Store, dataset: str | int, matches: Collection[str] | None = None
) -> DatasetProposalCounts:
    """What was proposed for the views of a dataset's matches; of all, or of these.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        found = require_dataset_with_matches(session, dataset, matches)
        items = count_proposals_by_match(session, found.id, matches)
    return DatasetProposalCounts(found.id, found.name, tuple(items))


def get_group_proposals(store: Store, group_id: int) -> list[tuple[str, bool, Proposal]]:
    """Key of the view, whether the proposal is open, and what was proposed for it.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        if read_group_change_basis(session, group_id) is None:
            raise NotFoundError.group(group_id)
        return read_group_proposals(session, group_id)


def propose_cameras_for_views(
    store: Store,
    dataset: str | int,
    matches: Collection[str] | None = None,
    *,
    workers: int | None = None,
    progress: ReportProgress | None = None,
    require_wanted: Callable[[], None] | None = None,
) -> ProposalRunReport:
    """Look at the pictures of all views that have neither a given camera nor one of their lines.

    Lines that determine no camera stay; what is proposed beside them are other markings. Which those
    are the last solution of their group says: groups that wait to be solved are left for later.

    Args:
        store: The database.
        dataset: Name or id.
        matches: By name; None: all.
        workers: How many pictures are looked at at once; None: as the settings say.
        progress: Called with views done and in all; an error that it raises ends the run.
        require_wanted: Called in each transaction that keeps something, before it does; what is
            not wanted any more it stops with an error.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        found = require_dataset_with_matches(session, dataset, matches)
        pending = list_views_to_propose_for(session, found.id, matches)
    count, total = workers or store.settings.image_workers, sum(len(views) for _, views in pending)
    run = ProposalRunReport()
    with (
        closing(VideoIndexer(store.settings)) as videos,
        closing(WorkerPool(LIMITS, count, 0, "pictures", COUNTS["proposals"])) as pool,
    ):
        for start in range(0, len(pending), _PER_WORKER * count):
            tasks = _make_tasks(store, found, dict(pending[start : start + _PER_WORKER * count]))
            views = [task.media for task in tasks]
            videos.index_videos(views, run.views, total, progress)
            answers = _run_tasks(store, pool, videos, tasks)
            with store.write() as session:
                if require_wanted is not None:
                    require_wanted()
                save_proposals(session, [item for item in answers if item is not None])
            for task, answer in zip(tasks, answers, strict=True):
                run = run.add_view(task, answer)
            if progress is not None:
                progress(run.views, total)
    return run


def forget_proposals(store: Store, dataset: str | int) -> int:
    """Forget everything that was proposed for a dataset; what was accepted stays what it is.

    Returns how many proposals there were.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.write() as session:
        gone = delete_proposals(session, require_dataset_id(session, dataset))
        session.respond(gone)
    return gone


def _make_tasks(
    store: Store, dataset: DatasetHead, views_by_group: dict[int, list[int]]
) -> list[ProposalTask]:
    tasks = []
    with store.read() as session:
        old = read_proposals(session, [view for views in views_by_group.values() for view in views])
        for stored in read_groups(session, list(views_by_group), extras=False).values():
            # The replays of a group look from elsewhere, but its main camera may be known, too.
            known = list_cameras_of_nearest_groups(session, stored)
            for key, number in stored.view_ids.items():
                if number in views_by_group[stored.id]:
                    tasks.append(_make_task(stored, key, known, dataset, old.get(number)))
    return [task for task in tasks if task is not None]


def _make_task(
    stored: StoredGroup, key: str, known: Sequence[Any], dataset: DatasetHead, old: Proposal | None
) -> ProposalTask | None:
    view, policy = stored.group.view(key), dataset.policy.calibration
    if view is None or view.media is None:
        return None
    station, pitch = view.station, stored.group.pitch
    # Which line of the paint is sought, where that is another than it always was.
    lines = [policy.goal] if policy.pitch_for_paint(pitch) != pitch else []
    inputs = [
        SEARCH_VERSION,
        [camera_to_json(camera) for camera in known],
        [float(pitch.length), float(pitch.width), *lines],
        [view.size.width, view.size.height, station.flipped],
        [float(policy.distortion_mean), float(policy.distortion_sigma)],
    ]
    return ProposalTask(
        view_id=stored.view_ids[key],
        media=view.media,
        flipped=station.flipped,
        size=view.size,
        known=tuple(known),
        pitch=pitch,
        policy=policy,
        sought_with=digest_json(inputs),
        old=old,
        drawn=station.lines,
        beside=station_digest(station) if station.lines else "",
    )


def _run_tasks(
    store: Store, pool: WorkerPool, videos: VideoIndexer, tasks: Sequence[ProposalTask]
) -> list[Proposal | None]:
    futures = [
        PictureTask(
            pool, *videos.make_worker_call(task.media, propose_lines_for_task, task, store.settings)
        )
        for task in tasks
    ]
    return [_wait_for_proposal(task, reads) for task, reads in zip(tasks, futures, strict=True)]


def _wait_for_proposal(task: ProposalTask, reads: PictureTask) -> Proposal | None:
    try:
        found: Proposal | None = reads.result()
    except (ImageError, TooLargeError):
        # Its process ended over it: to this service that picture is unreadable.
        return task.make_proposal_without_picture(UNREADABLE)
    return found
