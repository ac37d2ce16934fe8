"""Tracks as a job: made in a worker process, anew where their groups have changed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict
from typing import Any

from app.db.database_worker import ServerProxy
from app.db.json_columns import Json
from app.db.store import Store
from app.features.jobs.job_run import JobProgress, make_counts_reporter, run_job_in_worker
from app.features.match_estimates.jobs import MatchJobContext, MatchJobType
from app.features.tracks.service import make_tracks


def _make_tracks_in_worker(
    store: Store,
    dataset_id: int,
    matches: Collection[str] | None,
    actor: str,
    caller: ServerProxy,
) -> dict[str, Any]:
    """``make_tracks`` in a worker process."""
    return asdict(make_tracks(store, dataset_id, matches, actor, caller))


def _run_track_job(call: MatchJobContext, progress: JobProgress) -> Json:
    progress(0, None, "Reading what views measured of the ball.")
    return run_job_in_worker(
        call.store,
        "tracks",
        "tracking the ball",
        _make_tracks_in_worker,
        call.dataset_id,
        call.matches,
        call.job.actor,
        dataset_id=call.dataset_id,
        progress=progress,
        report=make_counts_reporter(progress, "groups read"),
    )


TRACKS = MatchJobType("ball", "Track the ball of {}", _run_track_job)
