"""Dataset lookup: from what an address names to the dataset that it belongs to, by one statement each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Select, and_, bindparam, or_, select

from app.store.session import Session
from app.store.tables.groups import DatasetModel, GroupModel, StationModel, ViewModel
from app.store.tables.jobs import JobModel
from app.store.tables.predictions import EvaluationModel, PredictionSetModel
from app.store.tables.saved_views import SavedViewModel, VerdictBatchModel
from app.store.tables.versions import VersionModel
from app.store.tables.work import BatchModel

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
    "work": select(BatchModel.dataset_id).where(BatchModel.id == _ID),
    "batch": select(VerdictBatchModel.dataset_id).where(VerdictBatchModel.id == _ID),
}
_GONE = and_(JobModel.dataset_id.is_not(None), JobModel.dataset_id.not_in(select(DatasetModel.id)))
_JOB = select(JobModel.dataset_id, JobModel.actor, JobModel.kind).where(JobModel.id == _ID, ~_GONE)


def dataset_of(session: Session, kind: str, identity: int) -> int | None:
    """Id of the dataset of a group, view, station and so on; None where there is no such thing."""
    found: int | None = session.scalar(_DATASET_OF[kind], {"id": identity})
    return found


def owner_of_job(session: Session, job_id: int) -> Any | None:
    """``dataset_id`` (or None), ``actor`` and ``kind`` of a job; None where there is none.

    A job whose dataset is gone is nobody's: admins alone, who ask for no owner, see it.
    """
    return session.execute(_JOB, {"id": job_id}).one_or_none()


def versions_like(session: Session, text: str) -> Sequence[Any]:
    """``id``, ``dataset_id``, ``name`` and ``hash`` of the versions that a text may name."""
    if "\0" in text:
        return []
    fits = [VersionModel.name == text, VersionModel.hash.startswith(text, autoescape=True)]
    if text.isascii() and text.isdigit() and len(text) < 19:
        fits.append(VersionModel.id == int(text))
    columns = (VersionModel.id, VersionModel.dataset_id, VersionModel.name, VersionModel.hash)
    return session.execute(select(*columns).where(or_(*fits))).all()
