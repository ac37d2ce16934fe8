"""Tables of predictions and evaluations: a third kind of data beside said and computed.

Nothing here is read by a solve. A prediction belongs to a view and goes with it; what a person
accepts becomes an edit of the group, in the log like any other.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class PredictionSetModel(Base):
    """What one file, or one run of a detector, predicted for a dataset.

    ``digest`` is that of all its boxes, cameras and tracks; ``report`` (JSON) tells what could not be
    read, which frames the dataset does not have, and where the predictions come from.
    """

    __tablename__ = "prediction_set"
    __table_args__ = (UniqueConstraint("dataset_id", "name", name="prediction_set_name"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    name: Mapped[str]
    format: Mapped[str]
    source: Mapped[str]
    created: Mapped[str]
    actor: Mapped[str]
    digest: Mapped[str]
    frames: Mapped[int]
    boxes: Mapped[int]
    cameras: Mapped[int]
    tracks: Mapped[int] = mapped_column(server_default="0")
    unknown: Mapped[int]
    report: Mapped[str]


class PredictionModel(Base):
    """One ball that was predicted in one view: pixels of the annotated size, and a score."""

    __tablename__ = "prediction"
    __table_args__ = (
        Index("prediction_set_view", "set_id", "view_id"),
        Index("prediction_view", "view_id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    set_id: Mapped[int] = mapped_column(ForeignKey("prediction_set.id", ondelete="CASCADE"))
    view_id: Mapped[int] = mapped_column(ForeignKey("view.id", ondelete="CASCADE"))
    x: Mapped[float]
    y: Mapped[float]
    width: Mapped[float]
    height: Mapped[float]
    score: Mapped[float]


class PredictedCameraModel(Base):
    """The camera (JSON) that was predicted for one view, at its annotated size."""

    __tablename__ = "predicted_camera"
    __table_args__ = (Index("predicted_camera_view", "view_id"),)

    set_id: Mapped[int] = mapped_column(
        ForeignKey("prediction_set.id", ondelete="CASCADE"), primary_key=True
    )
    view_id: Mapped[int] = mapped_column(
        ForeignKey("view.id", ondelete="CASCADE"), primary_key=True
    )
    camera: Mapped[str]


class PredictedTrackModel(Base):
    """The ball over a stretch (compressed JSON) as it was predicted; ``stretch`` is the file's name for it."""

    __tablename__ = "predicted_track"

    set_id: Mapped[int] = mapped_column(
        ForeignKey("prediction_set.id", ondelete="CASCADE"), primary_key=True
    )
    stretch: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class EvaluationModel(Base):
    """One run: what it pinned (JSON), and what it found.

    ``prediction_set_id`` and ``careful_set_id`` may name sets that were deleted since; ``pins``
    has their digests. ``tables`` is JSON, ``figures`` compressed JSON.
    """

    __tablename__ = "evaluation"
    __table_args__ = (Index("evaluation_dataset", "dataset_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    name: Mapped[str]
    created: Mapped[str]
    actor: Mapped[str]
    prediction_set_id: Mapped[int | None]
    careful_set_id: Mapped[int | None]
    version_id: Mapped[int | None]
    pins: Mapped[str]
    counts: Mapped[str]
    tables: Mapped[str]
    figures: Mapped[bytes] = mapped_column(LargeBinary)


class EvaluationFrameModel(Base):
    """One judged frame of a run; the columns are those of ``evaluation.result.FrameResult``.

    ``group_id`` and ``frame_id`` (the view's) are of the time of the run.
    """

    __tablename__ = "evaluation_frame"

    evaluation_id: Mapped[int] = mapped_column(
        ForeignKey("evaluation.id", ondelete="CASCADE"), primary_key=True
    )
    position: Mapped[int] = mapped_column(primary_key=True)
    frame_id: Mapped[int]
    group_id: Mapped[int]
    group: Mapped[str]
    view: Mapped[str]
    match: Mapped[str]
    ball: Mapped[bool]
    detections: Mapped[int]
    score: Mapped[float | None]
    iou: Mapped[float | None]
    hit_score: Mapped[float | None]
    hit_iou: Mapped[float | None]
    distance_m: Mapped[float | None]
    diameter_px: Mapped[float | None]
    parallax_degrees: Mapped[float | None]
    size_error_percent: Mapped[float | None]
    error_m: Mapped[float | None]
    error_percent: Mapped[float | None]
    any_error_m: Mapped[float | None]
    predicted_error_m: Mapped[float | None]
    predicted_error_percent: Mapped[float | None]
    predicted_any_error_m: Mapped[float | None]
    predicted_jac: Mapped[float | None]
    box_iou: Mapped[float | None]
