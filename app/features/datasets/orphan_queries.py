"""Orphans: what lies in a home and nothing uses, such as a killed deletion leaves behind."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

from sqlalchemy import delete, select, true

from app.config import Settings
from app.db.dialects.statements import items_of, texts_in
from app.db.home import DAY, last_written
from app.db.session import Session
from app.features.datasets.tables import ViewModel
from app.features.imports.upload_queries import list_uploads
from app.features.queue.tables import QueueModel
from app.features.recordings.tables import RecordingModel, ShotCamerasModel
from app.features.solutions.tables import CalibrationModel, SolutionModel
from app.object_store.address import is_address

_KEY = CalibrationModel.key
_items = items_of(SolutionModel.calibrations)
_NAMED = select(_items.c.value).select_from(SolutionModel).join(_items, true())
_UNUSED = select(_KEY).where(_KEY.not_in(_NAMED))


def unused_calibrations(session: Session) -> list[str]:
    """Keys of calibrations that no solution rests on; none while groups wait to be solved.

    A solver may have read them already for the solution that it is about to save.
    """
    return [] if _has_unsolved(session) else list(session.scalars(_UNUSED))


def delete_if_unused(session: Session, keys: Sequence[str]) -> int:
    """Delete those of some calibrations that are spare still; returns how many.

    Those that a version needs go on in it (a trigger sees to that).
    """
    if _has_unsolved(session):
        return 0
    named = _NAMED.where(_items.c.value.in_(texts_in(keys)))
    unused = (_KEY.in_(texts_in(keys)), _KEY.not_in(named))
    gone = delete(CalibrationModel).where(*unused).returning(_KEY)
    return len(session.scalars(gone).all())


def _has_unsolved(session: Session) -> bool:
    """Whether a group of any dataset waits to be solved."""
    waiting = select(QueueModel.group_id).where(QueueModel.solved.is_(False)).limit(1)
    return session.scalar(waiting) is not None


def unread_uploads(session: Session, settings: Settings) -> list[str]:
    """Ids of uploads that are kept for their frames, though no view has its frame there and none is a
    recording."""
    folders = {folder for path in _paths_in_use(session) for folder in path.parents}
    return [
        upload.id
        for upload in list_uploads(settings)
        if upload.kept and settings.uploads.absolute() / upload.id not in folders
    ]


def unused_frames(session: Session, settings: Settings) -> list[str]:
    """Folders and files of the home's recordings that no view and no recording uses."""
    used = {path.parent.name for path in _paths_in_use(session)}
    cameras = ShotCamerasModel
    for column in (RecordingModel.sha256, cameras.digest, cameras.before):
        used |= {sha256 for sha256 in session.scalars(select(column)) if sha256}
    if not settings.recordings.is_dir():
        return []
    return sorted(
        path.name
        for path in settings.recordings.iterdir()
        if path.name.partition(".")[0] not in {*used, ""}
    )


def _paths_in_use(session: Session) -> list[Path]:
    """Where frames of views and recordings lie on this disk."""
    statement = select(ViewModel.media_path).where(ViewModel.media_path.is_not(None)).distinct()
    found = [*session.scalars(statement), *session.scalars(select(RecordingModel.path))]
    return [Path(path) for path in found if path and not is_address(path)]


def expire_cache(settings: Settings) -> int:
    """Delete derived files that were made longer ago than the settings allow; returns how many."""
    oldest = time.time() - settings.cache_days * DAY
    gone = 0
    for folder, _, names in os.walk(settings.cache):
        for path in (Path(folder, name) for name in names):
            written = last_written(path)
            if written is not None and written < oldest:
                path.unlink(missing_ok=True)
                gone += 1
    return gone
