"""Frozen versions: their tables, rows that are written once and never change, those of their groups, and what came of
verifying them.

A version is sealed by its own row, which comes last: triggers refuse another group for it from
then on, every UPDATE, and every DELETE but the one that takes the whole dataset away.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

from sqlalchemy import ForeignKey, LargeBinary, Table, UniqueConstraint, func, insert, select
from sqlalchemy.orm import Mapped, mapped_column

from app.db.dialects.dialect import insert_or_replace
from app.db.home_paths import find_stored_path
from app.db.json_columns import Json, decompress_json, parse_json_column
from app.db.session import Base, Session, now
from app.db.store import Store
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import find_next_row_id
from app.features.people.visibility_queries import list_columns_with_shown_actor
from app.features.queue.tables import QueueModel
from app.features.solutions.queries import is_group_solved
from app.features.verdicts.tables import VerdictModel
from app.json_text import canonical_json_text
from app.soccer.solution import SOLVER_VERSION


class VersionModel(Base):
    """A frozen version; ``policy``, ``split`` and ``counts`` are canonical JSON.

    ``tracks`` (the same) has the keys of frozen tracks by their stretches; None: it has no tracks.

    ``hash`` covers annotations, verdicts, splits, policy and solver version, and nothing else:
    the same on every machine. ``previous`` is the id of the version frozen before.
    """

    __tablename__ = "version"
    __table_args__ = (UniqueConstraint("dataset_id", "name", name="version_name"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    name: Mapped[str]
    note: Mapped[str]
    licence: Mapped[str]
    created: Mapped[str]
    actor: Mapped[str]
    hash: Mapped[str]
    groups: Mapped[str]
    policy: Mapped[str]
    policy_hash: Mapped[str]
    solver_version: Mapped[str]
    software_version: Mapped[str]
    split: Mapped[str]
    counts: Mapped[str]
    previous: Mapped[int | None]
    tracks: Mapped[str | None]


class VersionGroupModel(Base):
    """One group of the dataset as a version has it, or the reason why it is not in it.

    Attributes:
        position: Place by match and key, from 0; the same on every machine.
        member: Whether the group is in the version; ``why`` says why not.
        split: Of the group; ``splits`` (JSON) by view where the views differ.
        verdict: JSON of what was decided, without who and when; None: nobody decided.
        said: Key of the frozen annotations; ``solution`` of the frozen solution.
        ball: JSON of the 3D ball.
        frames: Where the frames lie and what they weigh (compressed JSON); not in the hash.
    """

    __tablename__ = "version_group"
    __table_args__ = (UniqueConstraint("version_id", "key", name="version_group_key"),)

    version_id: Mapped[int] = mapped_column(
        ForeignKey("version.id", ondelete="CASCADE", deferrable=True, initially="DEFERRED"),
        primary_key=True,
    )
    position: Mapped[int] = mapped_column(primary_key=True)
    key: Mapped[str]
    match: Mapped[str]
    member: Mapped[bool]
    why: Mapped[str | None]
    split: Mapped[str]
    splits: Mapped[str | None]
    verdict: Mapped[str | None]
    said: Mapped[str | None]
    solution: Mapped[str | None]
    ball: Mapped[str | None]
    frames: Mapped[bytes | None] = mapped_column(LargeBinary)


class VersionCheckModel(Base):
    """What came of verifying a version the last time; ``report`` (JSON) as ``VerifyReport`` has it.

    ``problem`` says why nothing came of it, where it could not be done; then ``report`` is None.
    """

    __tablename__ = "version_check"

    version_id: Mapped[int] = mapped_column(
        ForeignKey("version.id", ondelete="CASCADE"), primary_key=True
    )
    at: Mapped[str]
    actor: Mapped[str]
    solver_version: Mapped[str]
    report: Mapped[str | None]
    problem: Mapped[str | None]


class FrozenModel(Base):
    """Content under a key that follows from it; versions of one dataset share it.

    ``said:``, ``station:``, ``track:`` and ``solution:`` with the digest of the content, ``calibration:``
    with the key that the solver gives it. The body of a calibration, most of what there is, stays
    NULL while the calibration is where the solver keeps it; a trigger saves it from deletion.
    """

    __tablename__ = "frozen"

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    key: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes | None] = mapped_column(LargeBinary)


BATCH = 200
_GROUPS = cast(Table, VersionGroupModel.__table__)
_VERSIONS = select(
    *list_columns_with_shown_actor(VersionModel), DatasetModel.name.label("dataset")
).join(DatasetModel, DatasetModel.id == VersionModel.dataset_id)


class VersionRow(NamedTuple):
    """A version with the name of its ``dataset``; ``actor`` as the reader may see them."""

    id: int
    dataset_id: int
    name: str
    note: str
    licence: str
    created: str
    actor: str
    hash: str
    groups: str
    policy: str
    policy_hash: str
    solver_version: str
    software_version: str
    split: str
    counts: str
    previous: int | None
    tracks: str | None
    dataset: str


class VersionGroupStateRow(NamedTuple):
    """What was said of a group of a version, as its hash and its differences need it."""

    key: str
    member: bool
    why: str | None
    split: str
    splits: str | None
    verdict: str | None
    said: str | None
    ball: str | None


class CandidateRow(NamedTuple):
    """A group of a dataset as it is judged, with what its newest verdict says."""

    group_id: int
    key: str
    match: str
    split: str
    view_keys: str
    status: str
    stale: bool
    passes: bool | None
    gate: str | None
    findings: str
    dismissed: str
    sigma_m: float | None
    solved: bool
    reason: str | None
    note: str | None
    override: str | None


@dataclass(frozen=True)
class VersionGroup:
    """One row of a version: a group that is in it, or the reason why it is not."""

    position: int
    key: str
    match: str
    member: bool
    why: str | None
    split: str
    splits: Mapping[str, str] | None
    verdict: Json
    said: str | None
    solution: str | None
    ball: tuple[float, float, float] | None
    frames: Mapping[str, Mapping[str, Any]] | None


def list_all_versions(session: Session) -> Sequence[VersionRow]:
    """The versions of every dataset, newest first, each with the name of its ``dataset``."""
    return session.rows(VersionRow, _VERSIONS.order_by(VersionModel.id.desc()))


def list_versions_of_dataset(session: Session, dataset_id: int) -> Sequence[VersionRow]:
    """The versions of a dataset, newest first, each with the name of its ``dataset``."""
    statement = _VERSIONS.where(VersionModel.dataset_id == dataset_id)
    return session.rows(VersionRow, statement.order_by(VersionModel.id.desc()))


def find_version_row(session: Session, version_id: int) -> VersionRow | None:
    """One version with the name of its ``dataset``."""
    return session.row(VersionRow, _VERSIONS.where(VersionModel.id == version_id))


def has_version(session: Session, dataset_id: int, name: str) -> bool:
    """Whether a dataset has a version of that name."""
    statement = select(VersionModel.id).where(
        VersionModel.dataset_id == dataset_id, VersionModel.name == name
    )
    return session.scalar(statement) is not None


def insert_version(
    session: Session, values: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]
) -> int:
    """Insert a version with its groups; returns its id."""
    identity = find_next_row_id(session, VersionModel)
    previous = session.scalar(
        select(func.max(VersionModel.id)).where(VersionModel.dataset_id == values["dataset_id"])
    )
    session.execute(insert(_GROUPS), [{**row, "version_id": identity} for row in rows])
    # Its own row comes last: from here on nothing can be added to the version.
    session.execute(insert(VersionModel), [{**values, "id": identity, "previous": previous}])
    return identity


def read_rows(
    session: Session, version_id: int, *, members: bool = False
) -> Iterator[VersionGroup]:
    """The rows of a version in their order, in batches."""
    rows = read_page(session, version_id, -1, BATCH, members=members)
    while rows:
        yield from rows
        rows = read_page(session, version_id, rows[-1].position, BATCH, members=members)


def read_page(
    session: Session, version_id: int, after: int, limit: int, *, members: bool = False
) -> list[VersionGroup]:
    """The next rows of a version after a position."""
    model = VersionGroupModel
    where = [model.member.is_(True)] if members else []
    statement = (
        select(*model.__table__.columns)
        .where(model.version_id == version_id, model.position > after, *where)
        .order_by(model.position)
        .limit(limit)
    )
    return [_version_group_from_row(session, row) for row in session.execute(statement)]


def iterate_version_group_state_rows(
    session: Session, version_id: int
) -> Iterator[VersionGroupStateRow]:
    """What was said of each group of a version, as its hash and its differences need it."""
    model = VersionGroupModel
    columns = (model.key, model.member, model.why, model.split, model.splits, model.verdict)
    statement = select(*columns, model.said, model.ball).where(model.version_id == version_id)
    yield from session.rows(VersionGroupStateRow, statement.order_by(model.position))


def iterate_version_verdicts(
    session: Session, version_id: int, *, member: bool
) -> Iterator[tuple[str, Json]]:
    """Key and verdict of the groups that are in a version, or of those that are not."""
    model = VersionGroupModel
    statement = (
        select(model.key, model.verdict)
        .where(model.version_id == version_id, model.member.is_(member))
        .order_by(model.position)
    )
    for key, verdict in session.execute(statement):
        yield key, None if verdict is None else parse_json_column(verdict)


def read_version_matches(session: Session, version_id: int) -> set[str]:
    """The matches that a version has groups of, members or not."""
    model = VersionGroupModel
    statement = select(model.match).where(model.version_id == version_id).distinct()
    return set(session.scalars(statement))


def list_candidate_rows(session: Session, dataset_id: int) -> Sequence[CandidateRow]:
    """Every group of a dataset as it is judged, with what its newest verdict says."""
    newest = (
        select(VerdictModel.group_id, func.max(VerdictModel.id).label("id"))
        .join(QueueModel, QueueModel.group_id == VerdictModel.group_id)
        .where(QueueModel.dataset_id == dataset_id)
        .group_by(VerdictModel.group_id)
        .subquery()
    )
    names = (
        "group_id",
        "key",
        "match",
        "split",
        "view_keys",
        "status",
        "stale",
        "passes",
        "gate",
        "findings",
        "dismissed",
        "sigma_m",
    )
    statement = (
        select(
            *(getattr(QueueModel, name) for name in names),
            is_group_solved().label("solved"),
            VerdictModel.reason,
            VerdictModel.note,
            VerdictModel.override,
        )
        .outerjoin(newest, newest.c.group_id == QueueModel.group_id)
        .outerjoin(VerdictModel, VerdictModel.id == newest.c.id)
        .where(QueueModel.dataset_id == dataset_id)
    )
    return session.rows(CandidateRow, statement)


def _version_group_from_row(session: Session, row: Any) -> VersionGroup:
    ball = None if row.ball is None else parse_json_column(row.ball)
    return VersionGroup(
        position=row.position,
        key=row.key,
        match=row.match,
        member=row.member,
        why=row.why,
        split=row.split,
        splits=None if row.splits is None else parse_json_column(row.splits),
        verdict=None if row.verdict is None else parse_json_column(row.verdict),
        said=row.said,
        solution=row.solution,
        ball=None if ball is None else (ball[0], ball[1], ball[2]),
        frames=None if row.frames is None else read_frozen_frames(session, row.frames),
    )


def read_frozen_frames(session: Session, body: bytes) -> dict[str, dict[str, Any]]:
    """Where the frames of a frozen group lie, by view, and what they weigh."""
    frames: dict[str, dict[str, Any]] = decompress_json(body)
    for frame in frames.values():
        if "path" in frame:
            frame["path"] = find_stored_path(session, frame["path"])
    return frames


@dataclass(frozen=True)
class Verification:
    """The last time that a version was computed once more.

    Attributes:
        at: When it ended.
        actor: Who asked for it.
        solver_version: Of the solver that computed.
        report: As ``VerifyReport.values`` has it; None where nothing came of it.
        problem: Why nothing came of it, else None.
    """

    at: str
    actor: str
    solver_version: str
    report: Json
    problem: str | None


def save_verification(
    store: Store, version_id: int, *, actor: str, report: Json = None, problem: str | None = None
) -> None:
    """Keep what came of verifying a version, in the place of what came of it before."""
    values = {
        "version_id": version_id,
        "at": now(),
        "actor": actor,
        "solver_version": SOLVER_VERSION,
        "report": None if report is None else canonical_json_text(report),
        "problem": problem,
    }
    statement = insert_or_replace(VersionCheckModel)
    with store.write() as session:
        session.execute(statement, [values], execution_options={"render_nulls": True})


def read_verifications(session: Session, versions: list[int]) -> dict[int, Verification]:
    """The last verification of versions, by id; those that nobody verified are left out."""
    model = VersionCheckModel
    statement = select(*model.__table__.columns).where(model.version_id.in_(versions))
    return {row.version_id: _verification_from_row(row) for row in session.execute(statement)}


def _verification_from_row(row: Any) -> Verification:
    report = None if row.report is None else parse_json_column(row.report)
    return Verification(row.at, row.actor, row.solver_version, report, row.problem)
