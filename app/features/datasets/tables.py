"""Tables of datasets, their cameras, groups and views as they are now.

Marks tell which groups have changed, in the order of their last change.
"""

from __future__ import annotations

from sqlalchemy import Double, ForeignKey, Index, LargeBinary, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


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


class UnassignedFrameModel(Base):
    """A frame that is no group (persons only) and is kept for export."""

    __tablename__ = "spare_frame"
    __table_args__ = (UniqueConstraint("dataset_id", "camera", "frame", name="spare_frame_key"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    camera: Mapped[str]
    frame: Mapped[str]
    extras: Mapped[bytes] = mapped_column(LargeBinary)


class ImportFindingModel(Base):
    """What an import noticed about a group (or a shared station) that a person had edited, and what
    matches and tracks say of groups.

    ``number`` is the finding's, ``place`` (JSON) x and y of where its ball would be. ``of_inputs`` is the
    hash of the group of which it is said: of another state of the group it says nothing; NULL: it stays.
    """

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
    number: Mapped[float | None] = mapped_column(Double)
    place: Mapped[str | None]
    of_inputs: Mapped[str | None]


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


class GroupChangeModel(Base):
    """The last change of a group, its inputs or its solution; triggers write it, nobody else.

    Ids grow with every change and are never given again: who remembers one finds what has
    changed since. A group from before there were marks has none.
    """

    __tablename__ = "group_change"
    __table_args__ = ({"sqlite_autoincrement": True},)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int]
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id", ondelete="CASCADE"), unique=True)
