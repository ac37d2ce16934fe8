"""Solutions in the database: inserted under their key, never changed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, cast

from sqlalchemy import (
    BindParameter,
    ColumnElement,
    ForeignKey,
    LargeBinary,
    ScalarSelect,
    Table,
    UniqueConstraint,
    and_,
    bindparam,
    func,
    select,
)
from sqlalchemy.orm import Mapped, mapped_column
from zlib_ng import zlib_ng

from app.db.dialects.dialect import insert, select_from_number_list
from app.db.json_columns import decompress, parse_json_column, translate_shape_errors_to_damage
from app.db.session import Base, Session
from app.errors import ConflictError
from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.queue.tables import QueueModel
from app.features.solutions import codec as value_codec
from app.features.solutions.codec import SolutionSummary, summarize_solution
from app.json_text import json_text
from app.soccer.group import Group
from app.soccer.solution import SOLVER_VERSION, Calibration, Solution

_ELSEWHERE = Calibration(source="", camera=None)
"""Stands in a stored solution for the calibration that is kept under its key."""
MOST_SEEN = 200_000
_SEEN: dict[str, bool] = {}
"""Whether calibrations leave their camera open, by key: they never change."""
_BATCH = 500
_KEYS: BindParameter[Any] = bindparam("keys", expanding=True)


class CalibrationModel(Base):
    """A calibration under the key that the solver gives it (compressed JSON)."""

    __tablename__ = "calibration"

    key: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class SolutionModel(Base):
    """A solution without its calibrations, which ``calibrations`` (JSON list) names.

    ``summary`` (JSON) is what the queue shows of it. ``facts`` is what the gates read of the group
    (``solving.facts``), NULL for a solution from before they were kept.
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


_SOLUTION = cast(Table, SolutionModel.__table__)
_SOLUTIONS = select(*_SOLUTION.columns).where(
    _SOLUTION.c.group_id.in_(bindparam("groups", expanding=True)),
    _SOLUTION.c.policy_hash.in_(bindparam("policies", expanding=True)),
    _SOLUTION.c.inputs_hash.in_(bindparam("inputs", expanding=True)),
)
_CALIBRATION = cast(Table, CalibrationModel.__table__)
_CALIBRATIONS = select(*_CALIBRATION.columns).where(_CALIBRATION.c.key.in_(_KEYS))
_KEPT = select(_CALIBRATION.c.key).where(_CALIBRATION.c.key.in_(_KEYS))


def is_current_solution() -> ColumnElement[bool]:
    """Whether a solution is that of its group's present state under its dataset's policy.

    To join ``SolutionModel`` with, where ``GroupModel`` and ``DatasetModel`` are joined already.
    """
    return and_(
        SolutionModel.group_id == GroupModel.id,
        SolutionModel.inputs_hash == GroupModel.inputs_hash,
        SolutionModel.policy_hash == DatasetModel.policy_hash,
        SolutionModel.solver_version == SOLVER_VERSION,
    )


def is_group_solved() -> ColumnElement[bool]:
    """Whether this solver has solved a group as it is, in a statement about rows of the queue.

    ``QueueModel.solved`` says so of any solver: the numbers of an earlier one stay in the row.
    """
    return (
        select(SolutionModel.id)
        .join(GroupModel, GroupModel.id == SolutionModel.group_id)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .where(GroupModel.id == QueueModel.group_id, is_current_solution())
        .correlate(QueueModel)
        .exists()
    )


def select_current_solution_id() -> ScalarSelect[int]:
    """Id of the solution of a group's present state under its dataset's policy: of this solver, else of
    the newest one that solved it.

    Where ``GroupModel`` and ``DatasetModel`` are joined already.
    """
    return (
        select(SolutionModel.id)
        .where(
            SolutionModel.group_id == GroupModel.id,
            SolutionModel.inputs_hash == GroupModel.inputs_hash,
            SolutionModel.policy_hash == DatasetModel.policy_hash,
        )
        .order_by((SolutionModel.solver_version == SOLVER_VERSION).desc(), SolutionModel.id.desc())
        .limit(1)
        .correlate(GroupModel, DatasetModel)
        .scalar_subquery()
    )


@dataclass(frozen=True)
class SolutionKey:
    """What a solution was computed from."""

    group_id: int
    inputs_hash: str
    policy_hash: str
    solver_version: str = SOLVER_VERSION


@dataclass(frozen=True)
class EncodedSolution:
    """A solution as it is stored; small enough to travel between processes."""

    calibrations: Mapping[str, bytes]
    """Calibrations by key, those that the encoder was not told to be known."""
    calibration_keys: tuple[str, ...]
    summary: SolutionSummary
    body: bytes
    facts: bytes | None


def encode_solution(
    group: Group, solution: Solution, known: Iterable[str] = (), facts: bytes | None = None
) -> EncodedSolution:
    """A solution as bytes; calibrations under a known key are not encoded again."""
    skip = set(known)
    calibrations = {
        view.calibration_key: encode_calibration(view.calibration)
        for view in solution.views
        if view.calibration_key not in skip
    }
    bare = tuple(replace(view, calibration=_ELSEWHERE) for view in solution.views)
    return EncodedSolution(
        calibrations=calibrations,
        calibration_keys=tuple(view.calibration_key for view in solution.views),
        summary=summarize_solution(group, solution),
        body=compress_json(value_codec.to_json(replace(solution, views=bare))),
        facts=facts,
    )


def encode_calibration(calibration: Calibration) -> bytes:
    """A calibration as compressed JSON."""
    return compress_json(value_codec.to_json(calibration))


@lru_cache(maxsize=256)
def decode_calibration(body: bytes) -> Calibration:
    """Back from ``encode_calibration``; one value for the same bytes, however often asked."""
    return value_codec.from_json(Calibration, parse_json_column(decompress(body)))


@lru_cache(maxsize=256)
def decode_calibration_without_markings(body: bytes) -> Calibration:
    """``decode_calibration`` without its markings, which are nine tenths of it."""
    text = decompress(body)
    # Quotes within a text are escaped, so these are the names of members.
    before, begins, rest = text.partition(b'"markings":[')
    _, ends, after = rest.partition(b'],"suspects":')
    if begins and ends:
        text = before + b'"markings":[],"suspects":' + after
    return value_codec.from_json(Calibration, parse_json_column(text))


def compress_json(value: object) -> bytes:
    """A value of ``value_codec.to_json`` as it is stored."""
    return zlib_ng.compress(value_codec.solution_json_text(value).encode())


def insert_solutions(
    session: Session, solutions: Sequence[tuple[SolutionKey, EncodedSolution]]
) -> None:
    """Insert solutions with their calibrations; what is already there stays.

    Raises:
        ConflictError: A calibration that the solver knew is gone by now.
    """
    bodies: dict[str, bytes] = {}
    for _key, encoded in solutions:
        bodies.update(encoded.calibrations)
    insert_calibrations(session, bodies)
    wanted = {key for _, encoded in solutions for key in encoded.calibration_keys}
    _require_calibrations_stored(session, wanted - set(bodies))
    if solutions:
        session.execute(
            insert(_SOLUTION).on_conflict_do_nothing(),
            [_solution_columns(key, encoded) for key, encoded in solutions],
        )


def _require_calibrations_stored(session: Session, wanted: set[str]) -> None:
    """A dataset that is deleted takes its calibrations along, and the solver may have read one."""
    if wanted and wanted - set(session.scalars(_KEPT, {"keys": list(wanted)})):
        raise ConflictError("a calibration was deleted while this was computed", hint="Try again.")


def insert_calibrations(session: Session, bodies: Mapping[str, bytes]) -> None:
    """Insert encoded calibrations by key; what is already there stays."""
    if bodies:
        session.execute(
            insert(_CALIBRATION).on_conflict_do_nothing(),
            [{"key": key, "body": body} for key, body in bodies.items()],
        )


def _solution_columns(key: SolutionKey, encoded: EncodedSolution) -> dict[str, object]:
    return {
        "group_id": key.group_id,
        "inputs_hash": key.inputs_hash,
        "policy_hash": key.policy_hash,
        "solver_version": key.solver_version,
        "calibrations": json_text(encoded.calibration_keys, ascii_=True),
        "summary": value_codec.solution_json_text(value_codec.to_json(encoded.summary)),
        "body": encoded.body,
        "facts": encoded.facts,
    }


def read_solutions(
    session: Session, keys: Iterable[SolutionKey], *, markings: bool = True
) -> dict[int, Solution]:
    """Solutions by group id; a group without one under its key is left out.

    Args:
        session: Any session.
        keys: Of the solutions.
        markings: Whether calibrations hold their markings.
    """
    wanted = {key.group_id: key for key in keys}
    found = {
        "groups": list(wanted),
        "policies": list({key.policy_hash for key in wanted.values()}),
        "inputs": list({key.inputs_hash for key in wanted.values()}),
    }
    rows = [
        row
        for row in session.execute(_SOLUTIONS, found)
        if wanted[row.group_id]
        == SolutionKey(row.group_id, row.inputs_hash, row.policy_hash, row.solver_version)
    ]
    with translate_shape_errors_to_damage():
        names = {name for row in rows for name in parse_json_column(row.calibrations)}
    decode = decode_calibration if markings else decode_calibration_without_markings
    bodies = read_calibration_bodies(session, names)
    calibrations = {key: decode(body) for key, body in bodies.items()}
    with translate_shape_errors_to_damage():
        return {
            row.group_id: attach_calibrations(_decode_solution_body(row.body), calibrations)
            for row in rows
        }


def decode_solution(value: Any, calibrations: Mapping[str, Calibration]) -> Solution:
    """A solution from the JSON value of its body and the calibrations that it names."""
    return attach_calibrations(value_codec.from_json(Solution, value), calibrations)


def attach_calibrations(solution: Solution, calibrations: Mapping[str, Calibration]) -> Solution:
    """A solution as it is stored, with the calibrations that it names."""
    views = tuple(
        replace(view, calibration=calibrations[view.calibration_key]) for view in solution.views
    )
    return replace(solution, views=views)


@lru_cache(maxsize=128)
def _decode_solution_body(body: bytes) -> Solution:
    return value_codec.from_json(Solution, parse_json_column(decompress(body)))


def read_calibrations(session: Session, keys: Iterable[str]) -> dict[str, Calibration]:
    """Calibrations by key; unknown keys are left out."""
    bodies = read_calibration_bodies(session, keys)
    return {key: decode_calibration(body) for key, body in bodies.items()}


def read_calibration_bodies(session: Session, keys: Iterable[str]) -> dict[str, bytes]:
    """Encoded calibrations by key; unknown keys are left out."""
    return {row.key: row.body for row in session.execute(_CALIBRATIONS, {"keys": list(keys)})}


def read_summary(text: str) -> SolutionSummary:
    """A stored summary."""
    return value_codec.from_json(SolutionSummary, parse_json_column(text))


def list_undetermined_calibrations(session: Session, keys: Collection[str]) -> set[str]:
    """The keys whose calibration has no camera, or one that its lines do not determine."""
    found = {key: _SEEN[key] for key in keys if key in _SEEN}
    unseen = sorted(set(keys) - set(found))
    if len(_SEEN) + len(unseen) > MOST_SEEN:
        _SEEN.clear()
    for start in range(0, len(unseen), _BATCH):
        bodies = read_calibration_bodies(session, unseen[start : start + _BATCH])
        found.update((key, _is_undetermined(body)) for key, body in bodies.items())
    _SEEN.update(found)
    return {key for key, is_open in found.items() if is_open}


def _is_undetermined(body: bytes) -> bool:
    """Told from the text: to decode it would take ten times as long."""
    text = decompress(body)
    return b'"camera":null' in text or b'"unobservable":[]' not in text


def filter_stored_calibration_keys(session: Session, keys: Iterable[str]) -> set[str]:
    """The keys under which a calibration is stored."""
    return set(session.scalars(_KEPT, {"keys": list(keys)}))


def read_current_solution_keys(
    session: Session, group_ids: Sequence[int]
) -> dict[int, SolutionKey]:
    """Key of the solution that fits each group as it is, whether there is one or not."""
    statement = (
        select(GroupModel.id, GroupModel.inputs_hash, DatasetModel.policy_hash)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .where(GroupModel.id.in_(group_ids))
    )
    return {row.id: SolutionKey(*row) for row in session.execute(statement)}


def read_current_solution_bodies(
    session: Session, ids: Sequence[int], policy_hash: str
) -> dict[int, bytes]:
    """Encoded solutions that fit the groups as they are, by the group's id."""
    statement = (
        select(SolutionModel.group_id, SolutionModel.body)
        .join(GroupModel, GroupModel.id == SolutionModel.group_id)
        .where(
            SolutionModel.group_id.in_(ids),
            SolutionModel.inputs_hash == GroupModel.inputs_hash,
            SolutionModel.policy_hash == policy_hash,
            SolutionModel.solver_version == SOLVER_VERSION,
        )
    )
    return {row.group_id: row.body for row in session.execute(statement)}


def find_newest_solution_id(session: Session) -> int:
    """Id of the last solution; 0 where there is none."""
    return session.scalar(select(func.max(SolutionModel.id))) or 0


class StoredGateFacts(NamedTuple):
    """What the gates read of a group, as it is stored beside its solution."""

    group_id: int
    inputs_hash: str
    calibrations: str
    facts: bytes | None


def read_solution_facts(session: Session, ids: Sequence[int]) -> Sequence[StoredGateFacts]:
    """The facts of solutions."""
    model = SolutionModel
    statement = select(model.group_id, model.inputs_hash, model.calibrations, model.facts)
    return session.rows(StoredGateFacts, statement.where(model.id.in_(ids)))


def list_solved_groups(session: Session, dataset_id: int) -> list[int]:
    """Ids of the groups of a dataset that have a solution that fits them as they are, in its order."""
    statement = (
        select(GroupModel.id)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .join(SolutionModel, is_current_solution())
        .where(GroupModel.dataset_id == dataset_id)
        .order_by(GroupModel.number)
    )
    return list(session.scalars(statement))


def list_unsolved_groups(
    session: Session, dataset_id: int, among: Collection[int] | None = None
) -> list[int]:
    """Ids of a dataset's groups, or of those among some of them, without a solution of this solver
    for their present state, in order."""
    some = () if among is None else (GroupModel.id.in_(select_from_number_list(among)),)
    statement = (
        select(GroupModel.id)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .outerjoin(SolutionModel, is_current_solution())
        .where(GroupModel.dataset_id == dataset_id, SolutionModel.id.is_(None), *some)
        .order_by(GroupModel.number)
    )
    return list(session.scalars(statement))
