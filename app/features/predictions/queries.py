"""Predictions and evaluations in the database: sets with their boxes and cameras, runs with their frames."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from sqlalchemy import ColumnElement, and_, delete, func, insert, select
from sqlalchemy.orm import InstrumentedAttribute

from app.db.json_columns import (
    Json,
    compress_json,
    decompress_json,
    parse_json_column,
    translate_shape_errors_to_damage,
)
from app.db.session import Session
from app.evaluation.prediction_run import PredictedTrack
from app.features.datasets.tables import DatasetModel, ViewModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.people.visibility_queries import list_columns_with_shown_actor
from app.features.predictions.tables import (
    EvaluationFrameModel,
    EvaluationModel,
    PredictedCameraModel,
    PredictedTrackModel,
    PredictionModel,
    PredictionSetModel,
)
from app.geometry.camera import Camera
from app.json_text import canonical_json_text
from app.soccer.codec import camera_from_json, camera_to_json, digest_json

_BATCH = 5000


Boxes = Mapping[int, Sequence[tuple[float, float, float, float, float]]]
"""x, y, width, height and score of each ball by id of the view, in the order of the file."""
Tracks = Mapping[str, PredictedTrack]
"""What was predicted of the ball over time, by stretch as the file calls it."""
_FRAME_BATCH = 2000
_MOST = 500
"""Runs of a dataset that are listed."""
_EVALUATIONS = select(
    *list_columns_with_shown_actor(EvaluationModel), DatasetModel.name.label("dataset")
).join(DatasetModel, DatasetModel.id == EvaluationModel.dataset_id)
FrameCondition = ColumnElement[bool]
"""Whether a frame is meant; made by the functions here."""
_KEEPING = ("evaluation_id", "position")


@dataclass(frozen=True)
class PredictionSet:
    """What one file or one run of a detector predicted.

    Attributes:
        format: ``coco``, ``yolo``, ``csv``, ``tracks``, ``cameras``, or ``detect`` for a detector of ours.
        source: Name of the file or of the model.
        frames: Frames with a box; ``boxes`` and ``cameras`` count those that have their frame.
        tracks: Stretches over which the ball was predicted.
        unknown: Frames that the dataset does not have.
        report: JSON; what could not be read, and where it comes from.
    """

    id: int
    dataset_id: int
    name: str
    format: str
    source: str
    created: str
    actor: str
    digest: str
    frames: int
    boxes: int
    cameras: int
    tracks: int
    unknown: int
    report: Json


@dataclass(frozen=True)
class PredictedBox:
    """One predicted ball: pixels of the view's annotated size."""

    id: int
    set_id: int
    view_id: int
    x: float
    y: float
    width: float
    height: float
    score: float


def digest_predictions(
    keys: Mapping[int, str],
    boxes: Boxes,
    cameras: Mapping[int, Camera],
    tracks: Tracks | None = None,
) -> str:
    """Digest of what was predicted, the same on every machine.

    Args:
        keys: A name of each view that does not depend on the database.
        boxes: By id of the view.
        cameras: By id of the view.
        tracks: By stretch.
    """
    predicted = sorted(
        (keys[view], [list(map(float, box)) for box in boxes[view]]) for view in boxes
    )
    seen = sorted((keys[view], camera_to_json(cameras[view])) for view in cameras)
    parts: list[list[Json]] = [[list(item) for item in predicted], [list(item) for item in seen]]
    # Sets without tracks keep the digest that they had before there were any.
    if tracks:
        parts.append([[name, track.to_json()] for name, track in sorted(tracks.items())])
    return digest_json(parts)


def insert_prediction_set(
    session: Session,
    values: Mapping[str, Any],
    boxes: Boxes,
    cameras: Mapping[int, Camera],
    tracks: Tracks | None = None,
) -> int:
    """Insert a set with everything that belongs to it; returns its id.

    Args:
        session: A write session.
        values: Columns of the set but its id, ``report`` as a JSON value.
        boxes: By id of the view.
        cameras: By id of the view.
        tracks: By stretch.
    """
    identity = find_next_row_id(session, PredictionSetModel)
    row = {**values, "id": identity, "report": canonical_json_text(values["report"])}
    session.execute(insert(PredictionSetModel), [row])
    names = ("x", "y", "width", "height", "score")
    rows = [
        {"set_id": identity, "view_id": view, **dict(zip(names, box, strict=True))}
        for view, found in boxes.items()
        for box in found
    ]
    for start in range(0, len(rows), _BATCH):
        session.execute(insert(PredictionModel), rows[start : start + _BATCH])
    seen = [
        {"set_id": identity, "view_id": view, "camera": canonical_json_text(camera_to_json(camera))}
        for view, camera in cameras.items()
    ]
    for start in range(0, len(seen), _BATCH):
        session.execute(insert(PredictedCameraModel), seen[start : start + _BATCH])
    for stretch, track in (tracks or {}).items():
        body = {"set_id": identity, "stretch": stretch, "body": compress_json(track.to_json())}
        session.execute(insert(PredictedTrackModel), [body])
    return identity


def delete_prediction_set(session: Session, set_id: int) -> None:
    """Delete a set with everything that belongs to it; nothing where there is none."""
    reserve_row_ids(session, PredictionSetModel)
    session.execute(delete(PredictionSetModel).where(PredictionSetModel.id == set_id))


def list_prediction_sets_of_dataset(session: Session, dataset_id: int) -> list[PredictionSet]:
    """The sets of a dataset, the newest first."""
    return _read_sets(session, PredictionSetModel.dataset_id == dataset_id)


def read_prediction_sets(session: Session, ids: Collection[int]) -> list[PredictionSet]:
    """Sets by their ids, the newest first; those that are not there are left out."""
    return _read_sets(session, PredictionSetModel.id.in_(ids)) if ids else []


def has_prediction_set(session: Session, dataset_id: int, name: str) -> bool:
    """Whether a dataset has a set of that name."""
    statement = select(PredictionSetModel.id).where(
        PredictionSetModel.dataset_id == dataset_id, PredictionSetModel.name == name
    )
    return session.scalar(statement) is not None


def read_boxes(session: Session, set_id: int) -> dict[int, list[PredictedBox]]:
    """Every box of a set, by id of the view, as they came."""
    found: dict[int, list[PredictedBox]] = {}
    for box in _read_boxes(session, PredictionModel.set_id == set_id):
        found.setdefault(box.view_id, []).append(box)
    return found


def read_view_boxes(session: Session, view_id: int) -> list[PredictedBox]:
    """Every box of a view over all sets, the newest set first, the surest box first."""
    found = _read_boxes(session, PredictionModel.view_id == view_id)
    return sorted(found, key=lambda box: (-box.set_id, -box.score, box.id))


def read_group_boxes(session: Session, group_id: int) -> list[PredictedBox]:
    """Every box of a group: by view, then as ``read_view_boxes``."""
    views = select(ViewModel.id, ViewModel.position).where(ViewModel.group_id == group_id)
    places = {row.id: row.position for row in session.execute(views)}
    found = _read_boxes(session, PredictionModel.view_id.in_(places))
    return sorted(found, key=lambda box: (places[box.view_id], -box.set_id, -box.score, box.id))


def read_box(session: Session, prediction_id: int) -> PredictedBox | None:
    """A box by its id."""
    return next(iter(_read_boxes(session, PredictionModel.id == prediction_id)), None)


def count_prediction_sets(session: Session, dataset_id: int) -> int:
    """How many sets a dataset has."""
    model = PredictionSetModel
    statement = select(func.count()).select_from(model).where(model.dataset_id == dataset_id)
    return session.scalar(statement) or 0


def read_predicted_cameras(session: Session, set_id: int) -> dict[int, Camera]:
    """Every camera of a set, by id of the view."""
    model = PredictedCameraModel
    rows = session.execute(select(model.view_id, model.camera).where(model.set_id == set_id))
    with translate_shape_errors_to_damage():
        return {row.view_id: camera_from_json(parse_json_column(row.camera)) for row in rows}


def read_predicted_tracks(session: Session, set_id: int) -> dict[str, PredictedTrack]:
    """Every track of a set, by stretch."""
    model = PredictedTrackModel
    rows = session.execute(select(model.stretch, model.body).where(model.set_id == set_id))
    with translate_shape_errors_to_damage():
        return {row.stretch: PredictedTrack.from_json(decompress_json(row.body)) for row in rows}


def _read_sets(session: Session, where: ColumnElement[bool]) -> list[PredictionSet]:
    statement = (
        select(*list_columns_with_shown_actor(PredictionSetModel))
        .where(where)
        .order_by(PredictionSetModel.id.desc())
    )
    return [
        PredictionSet(**{**row._mapping, "report": parse_json_column(row.report)})
        for row in session.execute(statement)
    ]


def _read_boxes(session: Session, *where: Any) -> Iterable[PredictedBox]:
    statement = (
        select(*PredictionModel.__table__.columns).where(*where).order_by(PredictionModel.id)
    )
    return [PredictedBox(**row._mapping) for row in session.execute(statement)]


@dataclass(frozen=True)
class StoredEvaluation:
    """A run without its figures and frames; ``pins``, ``counts`` and ``tables`` are JSON."""

    id: int
    dataset_id: int
    dataset: str
    name: str
    created: str
    actor: str
    prediction_set_id: int | None
    careful_set_id: int | None
    version_id: int | None
    pins: Json
    counts: Json
    tables: Json
    figures: tuple[str, ...]
    """Names."""


def insert_evaluation(
    session: Session, values: Mapping[str, Any], figures: Mapping[str, Json], frames: Sequence[Any]
) -> int:
    """Insert a run; returns its id.

    Args:
        session: A write session.
        values: Columns of the run but its id; ``pins``, ``counts`` and ``tables`` as JSON values.
        figures: By name.
        frames: Dataclasses whose fields are columns of ``EvaluationFrameModel``, in order.
    """
    identity = find_next_row_id(session, EvaluationModel)
    texts = {name: canonical_json_text(values[name]) for name in ("pins", "counts", "tables")}
    row = {**values, **texts, "id": identity, "figures": compress_json(dict(figures))}
    session.execute(insert(EvaluationModel), [row])
    for start in range(0, len(frames), _FRAME_BATCH):
        rows = [
            {**asdict(frame), "evaluation_id": identity, "position": position}
            for position, frame in enumerate(frames[start : start + _FRAME_BATCH], start)
        ]
        session.execute(
            insert(EvaluationFrameModel), rows, execution_options={"render_nulls": True}
        )
    return identity


def delete_evaluation(session: Session, evaluation_id: int) -> None:
    """Delete a run with its frames; nothing where there is none."""
    reserve_row_ids(session, EvaluationModel)
    session.execute(delete(EvaluationModel).where(EvaluationModel.id == evaluation_id))


def list_evaluations_of_dataset(session: Session, dataset_id: int) -> list[StoredEvaluation]:
    """The runs of a dataset, the newest first."""
    statement = _EVALUATIONS.where(EvaluationModel.dataset_id == dataset_id)
    rows = session.execute(statement.order_by(EvaluationModel.id.desc()).limit(_MOST))
    return [_evaluation_from_row(row) for row in rows]


def find_evaluation(session: Session, evaluation_id: int) -> StoredEvaluation | None:
    """A run by its id."""
    statement = _EVALUATIONS.where(EvaluationModel.id == evaluation_id)
    row = session.execute(statement).one_or_none()
    return None if row is None else _evaluation_from_row(row)


def read_chart(session: Session, evaluation_id: int, name: str) -> Json | None:
    """One figure of a run, or None."""
    statement = select(EvaluationModel.figures).where(EvaluationModel.id == evaluation_id)
    packed = session.execute(statement).scalar_one_or_none()
    return None if packed is None else decompress_json(packed).get(name)


def _evaluation_from_row(row: Any) -> StoredEvaluation:
    values = {item.name: getattr(row, item.name) for item in fields(StoredEvaluation)}
    for name in ("pins", "counts", "tables"):
        values[name] = parse_json_column(values[name])
    return StoredEvaluation(**{**values, "figures": tuple(decompress_json(row.figures))})


def match_condition(match: str) -> FrameCondition:
    """The frame is of a match."""
    return EvaluationFrameModel.match == match


def between_condition(column: str, low: float | None, high: float | None) -> FrameCondition:
    """The frame has a number, and it lies in [low, high)."""
    value = _get_frame_column(column)
    where: list[FrameCondition] = [value.is_not(None)]
    if low is not None:
        where.append(value >= low)
    if high is not None:
        where.append(value < high)
    return and_(*where)


def ball_without_number_condition(column: str) -> FrameCondition:
    """The frame has a ball and no such number."""
    return and_(_get_frame_column(column).is_(None), EvaluationFrameModel.ball.is_(True))


def count_frame_rows(
    session: Session, evaluation_id: int, conditions: Iterable[FrameCondition] = ()
) -> int:
    """How many frames of a run fulfil all conditions."""
    model = EvaluationFrameModel
    where = (model.evaluation_id == evaluation_id, *conditions)
    return session.scalar(select(func.count()).select_from(model).where(*where)) or 0


def read_frame_rows(
    session: Session,
    evaluation_id: int,
    conditions: Iterable[FrameCondition] = (),
    *,
    sort: str | None = None,
    descending: bool = False,
    limit: int | None = None,
    offset: int = 0,
) -> Iterator[dict[str, Any]]:
    """Frames of a run as values by column; a run never changes, so places are stable.

    ``sort`` is a column, whose missing numbers come last; None: as they stand in the dataset.
    """
    model = EvaluationFrameModel
    order: list[ColumnElement[Any]] = []
    if sort is not None:
        value = _get_frame_column(sort)
        order = [value.is_(None), value.desc() if descending else value.asc()]
    columns = [item for item in model.__table__.columns if item.name not in _KEEPING]
    statement = (
        select(*columns)
        .where(model.evaluation_id == evaluation_id, *conditions)
        .order_by(*order, model.position)
        .limit(limit)
        .offset(offset)
    )
    for row in session.execute(statement):
        yield dict(row._mapping)


def _get_frame_column(name: str) -> InstrumentedAttribute[Any]:
    column: InstrumentedAttribute[Any] = getattr(EvaluationFrameModel, name)
    return column
