"""Tracks in the database, and what they ask of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from sqlalchemy import Select, delete, insert, select, update

from app.db.dialects.dialect import select_from_number_list
from app.db.json_columns import parse_json_column, translate_shape_errors_to_damage
from app.db.session import Session
from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.queue.tables import QueueModel
from app.features.recordings.tables import BallRunModel, RecordingModel
from app.features.tracks.tables import TrackModel

_LARGE = ("inputs", "body", "patches")


class GroupStateForTracking(NamedTuple):
    """A group as far as a track depends on it, of which there are thousands."""

    key: str
    state: tuple[str, bool, bool]


@dataclass(frozen=True)
class GroupForTracking:
    """A group as far as its stretch asks.

    Attributes:
        state: What a track depends on: what was said, whether it is solved, whether it is rejected.
        rejected: Whether a person rejected it.
        place: Where its own views put the ball, pitch frame, metres; None where they do not.
        source: As what its dataset brought it, and how often it was changed.
    """

    id: int
    key: str
    state: tuple[str, bool, bool]
    rejected: bool
    place: tuple[float, float, float] | None
    source: tuple[str, int]


@dataclass(frozen=True)
class TrackBody:
    """What is large of a track, compressed.

    Attributes:
        inputs: What it was computed from.
        body: The track without corrections.
        patches: Parts that corrections changed; None where there are none.
    """

    inputs: bytes
    body: bytes
    patches: bytes | None


def read_recording_shots(session: Session, dataset_id: int) -> dict[str, list[tuple[int, int]]]:
    """First and last frames of the shots of a dataset's recordings, by name."""
    statement = select(RecordingModel.name, RecordingModel.shots).where(
        RecordingModel.dataset_id == dataset_id
    )
    with translate_shape_errors_to_damage():
        return {
            row.name: [(shot["first"], shot["last"]) for shot in parse_json_column(row.shots)]
            for row in session.execute(statement)
        }


def list_accepted_run_rows(session: Session, dataset_id: int) -> Sequence[Any]:
    """The accepted ball runs of a dataset whose video is still the same, without their frames, with ``name`` and
    ``video`` (sha256) of their recordings."""
    run, recording = BallRunModel, RecordingModel
    names = "id", "dataset_id", "recording_id", "first", "last", "revision"
    statement = (
        select(
            *(getattr(run, name) for name in names),
            recording.name.label("name"),
            recording.sha256.label("video"),
        )
        .join(recording, recording.id == run.recording_id)
        .where(
            run.dataset_id == dataset_id,
            run.accepted_by.is_not(None),
            run.sha256 == recording.sha256,
        )
        .order_by(run.id)
    )
    return session.execute(statement).all()


def find_dataset_match_and_key(session: Session, group_id: int) -> Any | None:
    """Dataset, match and key of a group; None where there is none."""
    columns = GroupModel.dataset_id, GroupModel.match, GroupModel.key
    return session.execute(select(*columns).where(GroupModel.id == group_id)).one_or_none()


def _select_without_bodies() -> Select[Any]:
    columns = [item for item in TrackModel.__table__.columns if item.name not in _LARGE]
    return select(*columns, DatasetModel.name.label("dataset")).join_from(
        TrackModel, DatasetModel, DatasetModel.id == TrackModel.dataset_id
    )


def list_track_rows(
    session: Session, dataset_id: int, matches: Collection[str] | None = None
) -> Sequence[Any]:
    """The tracks of a dataset, or of some of its matches, by match and frame, without what is large."""
    order = TrackModel.match, TrackModel.first, TrackModel.id
    statement = _select_without_bodies().where(TrackModel.dataset_id == dataset_id).order_by(*order)
    if matches is not None:
        statement = statement.where(TrackModel.match.in_(list(matches)))
    return session.execute(statement).all()


def find_track_row(session: Session, track_id: int) -> Any | None:
    """A track by its id, without what is large."""
    return session.execute(_select_without_bodies().where(TrackModel.id == track_id)).one_or_none()


def read_track_bodies(session: Session, track_ids: Collection[int]) -> dict[int, TrackBody]:
    """The large columns of tracks, by id."""
    model = TrackModel
    statement = select(model.id, model.inputs, model.body, model.patches).where(
        model.id.in_(select_from_number_list(track_ids))
    )
    return {
        row.id: TrackBody(row.inputs, row.body, row.patches) for row in session.execute(statement)
    }


def insert_track(session: Session, values: Mapping[str, Any]) -> int:
    """Insert a track; returns its id."""
    identity = find_next_row_id(session, TrackModel)
    session.execute(insert(TrackModel), [{"id": identity, **values}])
    return identity


def update_track(session: Session, track_id: int, **values: Any) -> None:
    """Change columns of a track."""
    session.execute(update(TrackModel).where(TrackModel.id == track_id).values(values))


def delete_tracks(session: Session, track_ids: Collection[int]) -> None:
    """Delete tracks."""
    reserve_row_ids(session, TrackModel)
    session.execute(delete(TrackModel).where(TrackModel.id.in_(select_from_number_list(track_ids))))


def list_group_keys_of_match(session: Session, dataset_id: int, match: str) -> Sequence[Any]:
    """Ids and keys of the groups of a match, in the order of the dataset."""
    statement = (
        select(GroupModel.id, GroupModel.key)
        .where(GroupModel.dataset_id == dataset_id, GroupModel.match == match)
        .order_by(GroupModel.number)
    )
    return session.execute(statement).all()


def read_group_states_by_match(
    session: Session, dataset_id: int, matches: Collection[str]
) -> dict[str, list[GroupStateForTracking]]:
    """What tracks of matches depend on, as ``read_groups_by_match`` has it, and nothing else: a third of its work."""
    statement = (
        select(
            GroupModel.match,
            GroupModel.key,
            GroupModel.inputs_hash,
            QueueModel.solved,
            QueueModel.status,
        )
        .outerjoin(QueueModel, QueueModel.group_id == GroupModel.id)
        .where(GroupModel.dataset_id == dataset_id, GroupModel.match.in_(list(matches)))
        .order_by(GroupModel.number)
    )
    found: dict[str, list[GroupStateForTracking]] = {}
    for match, key, inputs, solved, status in session.execute(statement):
        state = GroupStateForTracking(key, (inputs, bool(solved), status == "rejected"))
        found.setdefault(match, []).append(state)
    return found


def read_groups_by_match(
    session: Session,
    dataset_id: int,
    matches: Collection[str] | None = None,
    ids: Collection[int] | None = None,
) -> dict[str, list[GroupForTracking]]:
    """The groups of matches, or of all, by match, in the order of the dataset; of those with some ids alone."""
    queue = QueueModel
    statement = (
        select(
            GroupModel.id, GroupModel.key, GroupModel.match, GroupModel.inputs_hash,
            GroupModel.source_hash, GroupModel.revision, queue.solved, queue.status, queue.x_m, queue.y_m, queue.height_m,
        )
        .outerjoin(queue, queue.group_id == GroupModel.id)
        .where(GroupModel.dataset_id == dataset_id)
        .order_by(GroupModel.number)
    )  # fmt: skip
    if matches is not None:
        statement = statement.where(GroupModel.match.in_(list(matches)))
    if ids is not None:
        statement = statement.where(GroupModel.id.in_(select_from_number_list(ids)))
    found: dict[str, list[GroupForTracking]] = {}
    for row in session.execute(statement):
        place = None
        if row.x_m is not None and row.y_m is not None and row.height_m is not None:
            place = row.x_m, row.y_m, -row.height_m
        rejected = row.status == "rejected"
        state = row.inputs_hash, bool(row.solved), rejected
        source = row.source_hash, row.revision
        group = GroupForTracking(row.id, row.key, state, rejected, place, source)
        found.setdefault(row.match, []).append(group)
    return found
