"""Stored solutions: each as it stands in its row, with what it rests on, for whoever examines them.

Rows come in batches, so that those of a large home fit into memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from sqlalchemy import Select, select

from app.errors import StorageError
from app.soccer.solution import SOLVER_VERSION, Solution
from app.store.paint import reading_of
from app.store.session import Session
from app.store.solutions import decode_solution, is_current, read_calibrations
from app.store.stored_json import as_written, parse, unpack
from app.store.tables.groups import DatasetModel, GroupModel, PaintEvidenceModel
from app.store.tables.solutions import CalibrationModel, SolutionModel

_BATCH = 100
_SOLUTIONS = (
    select(
        *SolutionModel.__table__.columns,
        GroupModel.dataset_id,
        DatasetModel.policy,
        is_current().label("current"),
    )
    .join(GroupModel, GroupModel.id == SolutionModel.group_id)
    .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
    .where(SolutionModel.solver_version == SOLVER_VERSION)
    .order_by(SolutionModel.id)
    .limit(_BATCH)
)


def solution_batches(session: Session) -> Iterator[Sequence[Any]]:
    """Rows of every solution of this solver, each with its dataset's policy and whether it is the
    one that fits its group as it is (``current``)."""
    after = 0
    while rows := session.execute(_SOLUTIONS.where(SolutionModel.id > after)).all():
        yield rows
        after = rows[-1].id


def calibrations_of(row: Any) -> list[str]:
    """Keys of the calibrations that such a row names.

    Raises:
        DamagedError: The row is not what was written.
    """
    with as_written():
        return list(map(str, parse(row.calibrations)))


def decode_row(session: Session, row: Any) -> Solution:
    """The solution of such a row, with its calibrations.

    Raises:
        DamagedError: Its body, or a calibration, is not what was written, or is not there.
    """
    named = calibrations_of(row)
    calibrations = read_calibrations(session, named)
    with as_written():
        solution = decode_solution(unpack(row.body), calibrations)
        if named != [view.calibration_key for view in solution.views]:
            raise ValueError("its calibrations differ from those in its row")
        said = (solution.policy_hash, solution.solver_version)
        if said != (row.policy_hash, row.solver_version):
            raise ValueError("its policy or solver differs from the one in its row")
    return solution


def damaged_calibrations(session: Session) -> Iterator[tuple[str, bool]]:
    """The key of every calibration, and whether it is no longer what was written."""
    statement = select(CalibrationModel.key, CalibrationModel.body)
    for row in _streamed(session, statement):
        yield row.key, not _reads(unpack, row.body)


def damaged_readings(session: Session) -> Iterator[tuple[str, bool]]:
    """The digest of everything that was read of paint, and whether it is that of its content no
    longer."""
    statement = select(PaintEvidenceModel.digest, PaintEvidenceModel.body)
    for row in _streamed(session, statement):
        yield row.digest, not _reads(reading_of, row.digest, row.body)


def _streamed(session: Session, statement: Select[*tuple[Any, ...]]) -> Iterator[Any]:
    return iter(session.execute(statement, execution_options={"yield_per": _BATCH}))


def _reads(read: Callable[..., object], *stored: object) -> bool:
    try:
        read(*stored)
    except StorageError:
        return False
    return True
