"""Datasets in the database: names, policies, groups.

They also find the dataset that a named thing belongs to, and delete all that belongs to one.
"""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    Select,
    Table,
    and_,
    bindparam,
    delete,
    exists,
    func,
    insert,
    or_,
    select,
    true,
    update,
)

from app.config import Settings
from app.db.dialects.dialect import (
    DeferReferences,
    insert_or_replace,
    select_from_text_list,
    select_json_array_items,
)
from app.db.home import DAY, find_last_write_time
from app.db.home_paths import find_stored_path
from app.db.json_columns import parse_json_column, translate_shape_errors_to_damage
from app.db.session import COPIES_USED, Session, UsedIdModel
from app.features.batches.tables import BatchModel
from app.features.datasets.tables import DatasetModel, GroupModel, StationModel, ViewModel
from app.features.findings.queries import DismissalModel
from app.features.imports.upload_queries import list_uploads
from app.features.jobs.queries import JobModel
from app.features.people.visibility_queries import COPIES
from app.features.predictions.tables import EvaluationModel, PredictionSetModel
from app.features.queue.tables import QueueModel
from app.features.recordings.tables import RecordingModel, ShotCamerasModel
from app.features.saved_views.queries import SavedViewModel
from app.features.solutions.queries import CalibrationModel, SolutionModel
from app.features.tables import Base
from app.features.tracks.tables import TrackModel
from app.features.verdicts.tables import VerdictBatchModel, VerdictModel
from app.features.versions.queries import (
    BATCH,
    VersionGroupModel,
    VersionModel,
    read_frozen_frames,
)
from app.json_text import MAX_ID, canonical_json_text
from app.object_store.path import is_address
from app.soccer.codec import policy_from_json, policy_to_json
from app.soccer.policy import Policy

_DIGITS = 19
"""No id has more."""
_ROWS = select(*DatasetModel.__table__.columns)


_ID: Any = bindparam("id")
_DATASET_OF: Mapping[str, Select[Any]] = {
    "group": select(GroupModel.dataset_id).where(GroupModel.id == _ID),
    "view": select(GroupModel.dataset_id)
    .join(ViewModel, ViewModel.group_id == GroupModel.id)
    .where(ViewModel.id == _ID),
    "station": select(StationModel.dataset_id).where(StationModel.id == _ID),
    "predictions": select(PredictionSetModel.dataset_id).where(PredictionSetModel.id == _ID),
    "evaluation": select(EvaluationModel.dataset_id).where(EvaluationModel.id == _ID),
    "saved view": select(SavedViewModel.dataset_id).where(SavedViewModel.id == _ID),
    "recording": select(RecordingModel.dataset_id).where(RecordingModel.id == _ID),
    "track": select(TrackModel.dataset_id).where(TrackModel.id == _ID),
    "work": select(BatchModel.dataset_id).where(BatchModel.id == _ID),
    "batch": select(VerdictBatchModel.dataset_id).where(VerdictBatchModel.id == _ID),
}
_GONE = and_(JobModel.dataset_id.is_not(None), JobModel.dataset_id.not_in(select(DatasetModel.id)))
_JOB = select(JobModel.dataset_id, JobModel.actor, JobModel.kind).where(JobModel.id == _ID, ~_GONE)
_TABLES = Base.metadata.tables
_COUNTED = {
    "groups": "groups",
    "views": "view",
    "verdicts": "verdict",
    "saved_views": "saved_view",
    "batches": "batch",
    "annotations": "take",
    "recordings": "recording",
    "tracks": "track",
    "versions": "version",
    "predictions": "prediction_set",
    "evaluations": "evaluation",
}
"""What a person is told of, by the name of its table."""
_ACCESS = ("dataset_role", "access_token", "webhook")
"""Who may, or hears, what in a dataset; nothing that was said of its groups."""
_KEY = CalibrationModel.key
_items = select_json_array_items(SolutionModel.calibrations)
_NAMED = select(_items.c.value).select_from(SolutionModel).join(_items, true())
_UNUSED = select(_KEY).where(_KEY.not_in(_NAMED))


@lru_cache(maxsize=64)
def parse_stored_policy(text: str) -> Policy:
    """The policy of a dataset's row; one value a text, however often it is asked for."""
    with translate_shape_errors_to_damage():
        return policy_from_json(parse_json_column(text))


def list_dataset_rows(session: Session) -> Sequence[DatasetModel]:
    """The rows of all datasets, those of copies too, by name."""
    return session.rows(DatasetModel, _ROWS.order_by(DatasetModel.name))


def find_dataset(session: Session, dataset: str | int) -> DatasetModel | None:
    """The row of a dataset by name or id, or None."""
    if isinstance(dataset, int) or (
        len(dataset) <= _DIGITS and dataset.isascii() and dataset.isdigit()
    ):
        if int(dataset) > MAX_ID:
            return None
        statement = _ROWS.where(DatasetModel.id == int(dataset))
    elif "\0" in dataset:
        # PostgreSQL would refuse the question.
        return None
    else:
        statement = _ROWS.where(DatasetModel.name == dataset)
    return session.row(DatasetModel, statement)


def find_next_dataset_id(session: Session, *, copies: bool = False) -> int:
    """The id that the next dataset gets, or the next one of ``copies``."""
    column = DatasetModel.id
    mine = column > COPIES if copies else column <= COPIES
    newest = session.scalar(select(func.max(column)).where(mine))
    name = COPIES_USED if copies else DatasetModel.__tablename__
    used = session.scalar(select(UsedIdModel.id).where(UsedIdModel.table == name))
    return max(newest or 0, used or 0, COPIES if copies else 0) + 1


def insert_dataset_row(
    session: Session, name: str, policy: Policy, at: str, *, copies: bool = False
) -> int:
    """Insert a dataset, one of ``copies`` if so; returns its id."""
    identity = find_next_dataset_id(session, copies=copies)
    values = {"id": identity, "name": name, "created": at, **_policy_columns(policy)}
    session.execute(insert(DatasetModel), [values])
    return identity


def update_policy(session: Session, dataset_id: int, policy: Policy) -> None:
    """Judge a dataset by another policy; the queue is the caller's to refresh."""
    mine = DatasetModel.id == dataset_id
    session.execute(update(DatasetModel).where(mine).values(_policy_columns(policy)))


def list_group_ids(
    session: Session, dataset_id: int, matches: Collection[str] | None = None
) -> list[int]:
    """Ids of the groups of a dataset, of these matches where they are named, in order."""
    statement = select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)
    if matches is not None:
        statement = statement.where(GroupModel.match.in_(matches))
    return list(session.scalars(statement.order_by(GroupModel.id)))


def has_more_groups(session: Session, dataset_id: int, count: int) -> bool:
    """Whether a dataset has more groups than that; no more are counted."""
    statement = select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)
    return session.scalar(statement.offset(count).limit(1)) is not None


def has_match(session: Session, dataset_id: int, match: str) -> bool:
    """Whether a dataset has a group of a match; none is counted."""
    group = GroupModel
    found = exists().where(group.dataset_id == dataset_id, group.match == match)
    return bool(session.scalar(select(found)))


def read_dataset_name(session: Session, dataset_id: int) -> str:
    """The name of a dataset that is there."""
    return session.scalars(select(DatasetModel.name).where(DatasetModel.id == dataset_id)).one()


def read_dataset_names(session: Session) -> dict[int, str]:
    """The name of every dataset, by id."""
    statement = select(DatasetModel.id, DatasetModel.name)
    return {row.id: row.name for row in session.execute(statement)}


def _policy_columns(policy: Policy) -> dict[str, str]:
    return {"policy": canonical_json_text(policy_to_json(policy)), "policy_hash": policy.hash}


def find_owning_dataset(session: Session, kind: str, identity: int) -> int | None:
    """Id of the dataset of a group, view, station and so on; None where there is no such thing."""
    found: int | None = session.scalar(_DATASET_OF[kind], {"id": identity})
    return found


class JobOwner(NamedTuple):
    """Whose a job is: a dataset's, or who asked for it where it has none."""

    dataset_id: int | None
    actor: str
    kind: str


def find_job_owner(session: Session, job_id: int) -> JobOwner | None:
    """Whose a job is; None where there is none.

    A job whose dataset is gone is nobody's: admins alone, who ask for no owner, see it.
    """
    return session.row(JobOwner, _JOB, {"id": job_id})


class VersionIdentity(NamedTuple):
    """What a version can be named by."""

    id: int
    dataset_id: int
    name: str
    hash: str


def find_versions_by_text(session: Session, text: str) -> Sequence[VersionIdentity]:
    """The versions that a text may name."""
    if "\0" in text:
        return []
    fits = [VersionModel.name == text, VersionModel.hash.startswith(text, autoescape=True)]
    if text.isascii() and text.isdigit() and len(text) < 19:
        fits.append(VersionModel.id == int(text))
    columns = (VersionModel.id, VersionModel.dataset_id, VersionModel.name, VersionModel.hash)
    return session.rows(VersionIdentity, select(*columns).where(or_(*fits)))


def count_dataset_contents(session: Session, dataset_id: int) -> dict[str, int]:
    """How many groups, views, verdicts, versions and so on a dataset has."""
    counts = {}
    for word, name in _COUNTED.items():
        table = _TABLES[name]
        statement = (
            select(func.count())
            .select_from(table)
            .where(_build_dataset_condition(table, dataset_id))
        )
        counts[word] = session.scalar(statement) or 0
    return counts


def list_solution_ids(session: Session, dataset_id: int) -> list[int]:
    """Ids of the solutions of a dataset's groups."""
    mine = SolutionModel.group_id.in_(_group_ids_statement(dataset_id))
    return list(session.scalars(select(SolutionModel.id).where(mine)))


def delete_solutions(session: Session, ids: Sequence[int]) -> None:
    """Delete solutions; the calibrations that they rested on may be spare then."""
    session.execute(delete(SolutionModel).where(SolutionModel.id.in_(ids)))


def reserve_used_ids(session: Session) -> None:
    """No id is ever given again: the log speaks of what had it."""
    used = dict(session.execute(select(UsedIdModel.table, UsedIdModel.id)).all())
    newest = {
        table.name: session.scalar(select(func.max(table.c.id)))
        for table in Base.metadata.sorted_tables
        if list(table.primary_key.columns.keys()) == ["id"]
    }
    newest[DatasetModel.__tablename__] = find_next_dataset_id(session) - 1
    copies = find_next_dataset_id(session, copies=True) - 1
    newest[COPIES_USED] = copies if copies > COPIES else None
    for name, identity in newest.items():
        if identity and identity >= used.get(name, 0):
            statement = insert_or_replace(UsedIdModel)
            session.execute(statement, [{"table": name, "id": identity}])


def move_access_to_next_dataset(session: Session, dataset_id: int) -> int:
    """Let roles, tokens and webhooks of a dataset be those of the next that is made; returns its id.

    It has to be made in the same transaction.
    """
    session.execute(DeferReferences())
    heir_id = find_next_dataset_id(session)
    for name in _ACCESS:
        table = _TABLES[name]
        mine = table.c.dataset_id == dataset_id
        session.execute(update(table).where(mine).values(dataset_id=heir_id))
    return heir_id


def delete_dataset_rows(session: Session, dataset_id: int) -> None:
    """Delete everything that was said, from the leaves to the dataset itself.

    Tables that cascade (versions, predictions, evaluations) follow the rows that they hang on.
    """
    session.execute(DeferReferences())
    dataset, groups = _TABLES[DatasetModel.__tablename__], _TABLES[GroupModel.__tablename__]
    # The database lets verdicts and dismissals go while their group still tells whose they are.
    judged = [_TABLES[model.__tablename__] for model in (VerdictModel, DismissalModel)]
    for table in judged:
        session.execute(delete(table).where(_build_dataset_condition(table, dataset_id)))
    for table in filter(_needs_explicit_deletion, reversed(Base.metadata.sorted_tables)):
        if table not in (dataset, groups, *judged):
            session.execute(delete(table).where(_build_dataset_condition(table, dataset_id)))
    session.execute(delete(groups).where(_build_dataset_condition(groups, dataset_id)))
    session.execute(delete(dataset).where(dataset.c.id == dataset_id))


def _build_dataset_condition(table: Table, dataset_id: int) -> ColumnElement[bool]:
    """Whether a row belongs to the dataset: by its own column, its group's or its station's."""
    if "dataset_id" in table.c:
        return table.c.dataset_id == dataset_id
    stations = select(StationModel.id).where(StationModel.dataset_id == dataset_id)
    owners = {"group_id": _group_ids_statement(dataset_id), "station_id": stations}
    return or_(*(table.c[name].in_(ids) for name, ids in owners.items() if name in table.c))


def _group_ids_statement(dataset_id: int) -> Select[int]:
    return select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)


def _needs_explicit_deletion(table: Table) -> bool:
    """Whether rows refer to a dataset or a group and do not go with it by themselves."""
    return any(
        key.column.table.name in (DatasetModel.__tablename__, GroupModel.__tablename__)
        and key.ondelete is None
        for key in table.foreign_keys
    )


def list_unused_calibrations(session: Session) -> list[str]:
    """Keys of calibrations that no solution rests on; none while groups wait to be solved.

    A solver may have read them already for the solution that it is about to save.
    """
    return [] if _has_unsolved_groups(session) else list(session.scalars(_UNUSED))


def delete_unused_calibrations_of_keys(session: Session, keys: Sequence[str]) -> int:
    """Delete those of some calibrations that are spare still; returns how many.

    Those that a version needs go on in it (a trigger sees to that).
    """
    if _has_unsolved_groups(session):
        return 0
    named = _NAMED.where(_items.c.value.in_(select_from_text_list(keys)))
    unused = (_KEY.in_(select_from_text_list(keys)), _KEY.not_in(named))
    gone = delete(CalibrationModel).where(*unused).returning(_KEY)
    return len(session.scalars(gone).all())


def _has_unsolved_groups(session: Session) -> bool:
    """Whether a group of any dataset waits to be solved."""
    waiting = select(QueueModel.group_id).where(QueueModel.solved.is_(False)).limit(1)
    return session.scalar(waiting) is not None


def list_unused_uploads(session: Session, settings: Settings) -> list[str]:
    """Ids of uploads that are kept for their frames, though no view and no frozen version has a frame
    there and none is a recording."""
    folders = {name for path in _find_paths_in_use(session) for name in path.parts}
    return [
        upload.id for upload in list_uploads(settings) if upload.kept and upload.id not in folders
    ]


def is_upload_in_use(session: Session, upload_id: str) -> bool:
    """Whether a view has its frame in an upload, or it is a recording."""
    folder = f"/uploads/{upload_id}/"
    return any(
        session.scalar(select(column).where(column.contains(folder, autoescape=True)).limit(1))
        for column in (ViewModel.media_path, RecordingModel.path)
    )


def list_unused_frame_files(session: Session, settings: Settings) -> list[str]:
    """Folders and files of the home's recordings that no view, no frozen version and no recording uses."""
    used = {path.parent.name for path in _find_paths_in_use(session)}
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


def list_missing_recording_files(session: Session, settings: Settings) -> list[Path]:
    """Files of the home's recordings that are gone: indices and cameras of recordings, and frames of views."""
    cameras = ShotCamerasModel
    names = {
        f"{digest}{end}"
        for column, end in (
            (RecordingModel.sha256, ".npz"),
            (cameras.digest, ".cameras.npz"),
            (cameras.before, ".cameras.npz"),
        )
        for digest in session.scalars(select(column))
        if digest
    }
    folder = settings.recordings.absolute()
    frames = {path for path in _find_paths_of_views(session) if _is_of_recording(path)}
    return sorted(path for path in {folder / name for name in names} | frames if not path.exists())


def _is_of_recording(path: Path) -> bool:
    """Whether a path is that of a frame that a home keeps of a recording, called after its SHA-256."""
    return path.parent.parent.name == "recordings" and len(path.parent.name) == 64


def find_missing_path(session: Session) -> Path | None:
    """A file that a recording or a view names and that is gone; None: all are there."""
    paths = {*_find_paths_of_views(session), *_find_paths_of_recordings(session)}
    return next((path for path in sorted(paths) if not path.exists()), None)


def _find_paths_of_views(session: Session) -> set[Path]:
    statement = select(ViewModel.media_path).where(ViewModel.media_path.is_not(None)).distinct()
    found = (path for path in session.scalars(statement) if path and not is_address(path))
    return {Path(find_stored_path(session, path)) for path in found}


def _find_paths_of_recordings(session: Session) -> set[Path]:
    paths = session.scalars(select(RecordingModel.path))
    return {Path(find_stored_path(session, path)) for path in paths}


def _find_paths_in_use(session: Session) -> set[Path]:
    """Where frames of views, of frozen versions and of recordings lie on this disk."""
    found = {*_find_paths_of_views(session), *_find_paths_of_recordings(session)}
    frozen = select(VersionGroupModel.frames).where(VersionGroupModel.frames.is_not(None))
    # A group may be gone, or have other frames by now; its versions are exported with theirs.
    for body in session.scalars(frozen.execution_options(yield_per=BATCH)):
        frames = read_frozen_frames(session, body or b"").values()
        paths = {frame["path"] for frame in frames if "path" in frame}
        found |= {Path(path) for path in paths if not is_address(path)}
    return found


def delete_expired_cache_entries(settings: Settings) -> int:
    """Delete derived files that were made longer ago than the settings allow; returns how many."""
    oldest = time.time() - settings.cache_days * DAY
    gone = 0
    for folder, _, names in os.walk(settings.cache):
        for path in (Path(folder, name) for name in names):
            written = find_last_write_time(path)
            if written is not None and written < oldest:
                path.unlink(missing_ok=True)
                gone += 1
    return gone
