"""Solutions under earlier policies, and each stored solution with what it rests on."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from sqlalchemy import Select, select

from app.db.json_columns import (
    Json,
    decompress,
    decompress_json,
    parse_json_column,
    translate_shape_errors_to_damage,
)
from app.db.session import Session
from app.errors import StorageError
from app.features.datasets.tables import DatasetModel, GroupModel, PaintEvidenceModel
from app.features.paint.queries import decode_paint_reading
from app.features.solutions import codec as value_codec
from app.features.solutions.codec import replace_gates_in_summary
from app.features.solutions.queries import (
    CalibrationModel,
    EncodedSolution,
    SolutionModel,
    compress_json,
    decode_solution,
    is_current_solution,
    read_calibrations,
    read_summary,
)
from app.soccer.solution import SOLVER_VERSION, Solution


@dataclass(frozen=True)
class ReusableSolution:
    """A solution as it is stored, of its group's present state; ``group`` is the key of that."""

    group_id: int
    group: str
    inputs_hash: str
    policy_hash: str
    calibrations: str
    summary: str
    body: bytes
    facts: bytes

    @cached_property
    def solution(self) -> Solution:
        """The solution, without what its calibrations say.

        Raises:
            DamagedError: It is not what was written.
        """
        bare: Solution = value_codec.from_json(Solution, self._body_json)
        return bare

    @cached_property
    def _body_json(self) -> Json:
        return parse_json_column(decompress(self.body))

    def encode(self, solution: Solution) -> EncodedSolution:
        """A solution that differs from this one in its gates, findings and policy alone.

        What is the same value is the same text: numbers are not written anew.

        Raises:
            DamagedError: What is stored beside it is not what was written.
        """
        before = self.solution
        with translate_shape_errors_to_damage():
            value = {
                **self._body_json,
                "gates": _update_changed_json(
                    self._body_json["gates"], before.gates, solution.gates
                ),
                "findings": _update_changed_json(
                    self._body_json["findings"], before.findings, solution.findings
                ),
                "policy_hash": solution.policy_hash,
            }
            keys = tuple(parse_json_column(self.calibrations))
        summary = replace_gates_in_summary(read_summary(self.summary), solution)
        return EncodedSolution({}, keys, summary, compress_json(value), self.facts)


def _update_changed_json(
    values: Sequence[Json], before: Sequence[object], now: Sequence[object]
) -> list[Json]:
    """JSON values of what was before, with those of what is another value now."""
    return [
        value if old is new else value_codec.to_json(new)
        for value, old, new in zip(values, before, now, strict=True)
    ]


def list_reusable_solutions(
    session: Session, group_ids: Sequence[int], policies: Collection[str]
) -> list[ReusableSolution]:
    """One solution of each group under one of the policies, of those that have facts beside them.

    Args:
        session: Any session.
        group_ids: At most a few hundred.
        policies: Hashes of policies.
    """
    group, model = GroupModel, SolutionModel
    # mypy would have it that facts may be None; the condition says that they are not.
    statement: Any = (
        select(
            group.id, group.key, model.inputs_hash, model.policy_hash,
            model.calibrations, model.summary, model.body, model.facts,
        )
        .join(group, group.id == model.group_id)
        .where(
            model.group_id.in_(group_ids),
            model.inputs_hash == group.inputs_hash,
            model.policy_hash.in_(list(policies)),
            model.solver_version == SOLVER_VERSION,
            model.facts.is_not(None),
        )
        .order_by(model.id)
    )  # fmt: skip
    rows = (ReusableSolution(*row) for row in session.execute(statement))
    return list({row.group_id: row for row in rows}.values())


_BATCH = 100
_SOLUTIONS = (
    select(
        *SolutionModel.__table__.columns,
        GroupModel.dataset_id,
        DatasetModel.policy,
        is_current_solution().label("current"),
    )
    .join(GroupModel, GroupModel.id == SolutionModel.group_id)
    .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
    .where(SolutionModel.solver_version == SOLVER_VERSION)
    .order_by(SolutionModel.id)
    .limit(_BATCH)
)


def iterate_solution_row_chunks(session: Session) -> Iterator[Sequence[Any]]:
    """Rows of every solution of this solver, each with its dataset's policy and whether it is the
    one that fits its group as it is (``current``)."""
    after = 0
    while rows := session.execute(_SOLUTIONS.where(SolutionModel.id > after)).all():
        yield rows
        after = rows[-1].id


def list_calibration_keys_of_row(row: Any) -> list[str]:
    """Keys of the calibrations that such a row names.

    Raises:
        DamagedError: The row is not what was written.
    """
    with translate_shape_errors_to_damage():
        return list(map(str, parse_json_column(row.calibrations)))


def decode_solution_row(session: Session, row: Any) -> Solution:
    """The solution of such a row, with its calibrations.

    Raises:
        DamagedError: Its body, or a calibration, is not what was written, or is not there.
    """
    named = list_calibration_keys_of_row(row)
    calibrations = read_calibrations(session, named)
    with translate_shape_errors_to_damage():
        solution = decode_solution(decompress_json(row.body), calibrations)
        if named != [view.calibration_key for view in solution.views]:
            raise ValueError("its calibrations differ from those in its row")
        stored = (solution.policy_hash, solution.solver_version)
        if stored != (row.policy_hash, row.solver_version):
            raise ValueError("its policy or solver differs from the one in its row")
    return solution


def check_stored_calibrations(session: Session) -> Iterator[tuple[str, bool]]:
    """The key of every calibration, and whether it is no longer what was written."""
    statement = select(CalibrationModel.key, CalibrationModel.body)
    for row in _stream_rows(session, statement):
        yield row.key, not _is_readable(decompress_json, row.body)


def check_stored_paint_readings(session: Session) -> Iterator[tuple[str, bool]]:
    """The digest of everything that was read of paint, and whether it is that of its content no
    longer."""
    statement = select(PaintEvidenceModel.digest, PaintEvidenceModel.body)
    for row in _stream_rows(session, statement):
        yield row.digest, not _is_readable(decode_paint_reading, row.digest, row.body)


def _stream_rows(session: Session, statement: Select[*tuple[Any, ...]]) -> Iterator[Any]:
    return iter(session.execute(statement, execution_options={"yield_per": _BATCH}))


def _is_readable(read: Callable[..., object], *stored: object) -> bool:
    try:
        read(*stored)
    except StorageError:
        return False
    return True
