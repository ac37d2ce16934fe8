"""The tables: what people said, its append-only log, and what was computed from it.

``dataset``, ``station``, ``groups`` and ``view`` hold the present state of what was said; the
``log`` can rebuild them. ``verdict`` and ``log`` only grow, ``solution`` and ``calibration`` are
inserted and never changed (triggers see to it). ``queue`` is a projection of all of these, one
row a group, made for filters and sorts.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, LargeBinary, UniqueConstraint, text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

QUEUE_NUMBERS = (
    "passes",
    "value",
    "margin",
    "min_jac",
    "agreement",
    "error_px",
    "error_percent",
    "sigma_m",
    "parallax_degrees",
    "size_ratio",
    "height_m",
    "distance_m",
)
"""Columns of the queue with an index of their own."""
QUEUE_SCANNED = (
    "number",
    "status",
    "stale",
    "fixed",
    "solved",
    "views",
    "pictures",
    *QUEUE_NUMBERS,
    "box_px",
    "x_m",
    "y_m",
    "gate",
    "split",
    "findings",
)
"""Columns of the queue that one index holds, in its order: what is asked of every group of a
dataset is read from there, a third of what the rows take."""


class Base(DeclarativeBase):
    """Base of all tables."""


class DatasetModel(Base):
    """A dataset and the policy that judges it (canonical JSON).

    ``noise`` (JSON) is that of the balls of cameras and people unlike the dataset's, as accepted.
    """

    __tablename__ = "dataset"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    created: Mapped[str]
    policy: Mapped[str]
    policy_hash: Mapped[str]
    noise: Mapped[str | None]


class StationModel(Base):
    """A camera: its lines, its given camera and its picture (JSON), and which camera counts.

    ``proposed`` (JSON list) names the lines that were accepted as they were proposed.

    ``digest`` is that of what solving reads; ``source_digest`` the same of what the dataset last
    brought, so a person edited the station exactly when the two differ.
    """

    __tablename__ = "station"
    __table_args__ = (
        Index(
            "station_shared_key",
            "dataset_id",
            "key",
            unique=True,
            sqlite_where=text("shared = 1"),
            postgresql_where=text("shared"),
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    key: Mapped[str]
    shared: Mapped[bool]
    width: Mapped[int]
    height: Mapped[int]
    flipped: Mapped[bool]
    calibration: Mapped[str]
    lines: Mapped[str]
    given: Mapped[str | None]
    picture: Mapped[str | None]
    proposed: Mapped[str | None]
    revision: Mapped[int]
    digest: Mapped[str]
    source_digest: Mapped[str]


class GroupModel(Base):
    """A group; ``source_hash`` is that of the whole group as the dataset last brought it.

    ``positions`` (JSON by view) is what its match says of where cameras stand, ``paint`` (JSON by
    view) names what was read of the pictures' paint.
    """

    __tablename__ = "groups"
    __table_args__ = (
        UniqueConstraint("dataset_id", "key", name="groups_key"),
        UniqueConstraint("dataset_id", "number", name="groups_number"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    number: Mapped[int]
    key: Mapped[str]
    match: Mapped[str]
    split: Mapped[str]
    label: Mapped[str]
    pitch_length: Mapped[float]
    pitch_width: Mapped[float]
    positions: Mapped[str | None]
    paint: Mapped[str | None]
    revision: Mapped[int]
    changed: Mapped[str]
    inputs_hash: Mapped[str]
    source_hash: Mapped[str]


class ViewModel(Base):
    """One image of a group: balls (JSON), media, and extras (compressed JSON).

    ``left_out`` (JSON) is why a person left it out, where they said so. ``noise`` is that of its
    ball beside the dataset's, where it is another.
    """

    __tablename__ = "view"
    __table_args__ = (
        UniqueConstraint("group_id", "key", name="view_key"),
        Index("view_station", "station_id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    station_id: Mapped[int] = mapped_column(ForeignKey("station.id"))
    position: Mapped[int]
    key: Mapped[str]
    included: Mapped[bool]
    left_out: Mapped[str | None]
    noise: Mapped[float | None]
    balls: Mapped[str]
    media_path: Mapped[str | None]
    media_member: Mapped[str | None]
    media_frame: Mapped[int | None]
    extras: Mapped[bytes | None] = mapped_column(LargeBinary)
    digest: Mapped[str]
    source_digest: Mapped[str]


class SpareFrameModel(Base):
    """A frame that is no group (persons only) and is kept for export."""

    __tablename__ = "spare_frame"
    __table_args__ = (UniqueConstraint("dataset_id", "camera", "frame", name="spare_frame_key"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    camera: Mapped[str]
    frame: Mapped[str]
    extras: Mapped[bytes] = mapped_column(LargeBinary)


class ImportFindingModel(Base):
    """What an import noticed about a group (or a shared station) that a person had edited."""

    __tablename__ = "import_finding"
    __table_args__ = (
        Index("import_finding_group", "group_id"),
        Index("import_finding_station", "station_id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int | None] = mapped_column(ForeignKey("groups.id"))
    station_id: Mapped[int | None] = mapped_column(ForeignKey("station.id"))
    view: Mapped[str | None]
    kind: Mapped[str]
    sentence: Mapped[str]


class PaintEvidenceModel(Base):
    """What was read of the paint of a picture (compressed JSON), under its own digest.

    ``reason`` is why it is not solved with, or None, for those who count.
    Rows are inserted, never changed (a trigger sees to it) and go with their dataset; groups and the
    log name them.
    """

    __tablename__ = "paint_evidence"

    digest: Mapped[str] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"), primary_key=True)
    reason: Mapped[str | None]
    body: Mapped[bytes] = mapped_column(LargeBinary)


class CalibrationModel(Base):
    """A calibration under the key that the solver gives it (compressed JSON)."""

    __tablename__ = "calibration"

    key: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class SolutionModel(Base):
    """A solution without its calibrations, which ``calibrations`` (JSON list) names.

    ``summary`` (JSON) is what the queue shows of it. ``facts`` is what the gates read of the group
    (``solving.facts_codec``), NULL for a solution from before they were kept.
    """

    __tablename__ = "solution"
    __table_args__ = (
        UniqueConstraint(
            "group_id", "inputs_hash", "policy_hash", "solver_version", name="solution_key"
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    inputs_hash: Mapped[str]
    policy_hash: Mapped[str]
    solver_version: Mapped[str]
    calibrations: Mapped[str]
    summary: Mapped[str]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    facts: Mapped[bytes | None] = mapped_column(LargeBinary)


class VerdictModel(Base):
    """One person's verdict on one state of a group; the newest is the effective one.

    ``override`` names the gate that failed when the group was accepted all the same.
    """

    __tablename__ = "verdict"
    __table_args__ = (Index("verdict_group", "group_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    actor: Mapped[str]
    at: Mapped[str]
    state: Mapped[str]
    reason: Mapped[str | None]
    note: Mapped[str | None]
    inputs_hash: Mapped[str]
    policy_hash: Mapped[str]
    fixed: Mapped[bool]
    override: Mapped[str | None]


class LogModel(Base):
    """Everything that was ever said, in order; each row's hash covers the row before."""

    __tablename__ = "log"
    __table_args__ = (
        Index("log_group", "group_id", "id"),
        Index("log_station", "station_id"),
        Index(
            "log_policy",
            "dataset_id",
            "id",
            sqlite_where=text("kind IN ('dataset', 'policy')"),
            postgresql_where=text("kind IN ('dataset', 'policy')"),
        ),
        Index(
            "log_deleted",
            "dataset_id",
            sqlite_where=text("kind = 'dataset_deleted'"),
            postgresql_where=text("kind = 'dataset_deleted'"),
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[str]
    actor: Mapped[str]
    kind: Mapped[str]
    dataset_id: Mapped[int | None]
    group_id: Mapped[int | None]
    station_id: Mapped[int | None]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    hash: Mapped[str]


class QueueModel(Base):
    """One row a group, for lists: everything that can be filtered or sorted, in plain columns.

    ``findings`` and ``view_keys`` are lists between commas: ``,low_parallax,bad_point,``.
    ``value`` is the smallest relative distance to a gate's threshold; ``pictures`` counts the
    views that have one.
    """

    __tablename__ = "queue"
    __table_args__ = (
        Index("queue_number", "dataset_id", "number"),
        Index("queue_status", "dataset_id", "status", "number"),
        Index("queue_scanned", "dataset_id", *QUEUE_SCANNED),
        # Sorted by any of them, a page of a million groups is read from where it begins.
        *(Index(f"queue_{name}", "dataset_id", name, "number") for name in QUEUE_NUMBERS),
    )

    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"), primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    number: Mapped[int]
    key: Mapped[str]
    label: Mapped[str]
    match: Mapped[str]
    split: Mapped[str]
    changed: Mapped[str]
    views: Mapped[int]
    view_keys: Mapped[str]
    pictures: Mapped[int] = mapped_column(server_default=text("0"))
    main_view: Mapped[int | None]
    status: Mapped[str]
    stale: Mapped[bool]
    reason: Mapped[str | None]
    reviewer: Mapped[str | None]
    override: Mapped[str | None]
    fixed: Mapped[bool]
    solved: Mapped[bool]
    passes: Mapped[bool | None]
    gate: Mapped[str | None]
    gate_view: Mapped[str | None]
    gate_sentence: Mapped[str | None]
    margin: Mapped[float | None]
    value: Mapped[float | None]
    min_jac: Mapped[float | None]
    error_px: Mapped[float | None]
    error_percent: Mapped[float | None]
    sigma_m: Mapped[float | None]
    parallax_degrees: Mapped[float | None]
    size_ratio: Mapped[float | None]
    height_m: Mapped[float | None]
    findings: Mapped[str]
    distance_m: Mapped[float | None]
    box_px: Mapped[float | None]
    x_m: Mapped[float | None]
    y_m: Mapped[float | None]
    agreement: Mapped[float | None]
