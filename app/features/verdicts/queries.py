"""Verdicts in the database: everyone's are kept, the newest counts.

Batches of verdicts were given at once and are undone at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

from sqlalchemy import Table, bindparam, case, func, insert, select, update

from app.db.json_columns import parse_json_column
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session
from app.features.batches.completion_queries import complete_judged_groups
from app.features.datasets.tables import GroupModel
from app.features.groups.insert_queries import find_next_row_id
from app.features.independent_annotations.submission_queries import submit_copy_on_verdict
from app.features.people.visibility_queries import (
    COPIES,
    shown_actor_column,
    visible_groups_condition,
)
from app.features.verdicts.tables import VerdictBatchModel, VerdictModel
from app.json_text import json_text


@dataclass(frozen=True)
class StoredVerdict:
    """What one person decided on one state of a group, as ``VerdictModel`` has it."""

    id: int
    group_id: int
    actor: str
    at: str
    state: str
    reason: str | None
    note: str | None
    inputs_hash: str
    policy_hash: str
    fixed: bool
    override: str | None


_VERDICT = cast(Table, VerdictModel.__table__)
_OF_GROUPS = (
    select(*_VERDICT.columns)
    .where(_VERDICT.c.group_id.in_(bindparam("ids", expanding=True)))
    .order_by(_VERDICT.c.id.desc())
)
_SHOWN = [column for column in _VERDICT.columns if column.name != "actor"]
_LAST_OF_EACH = (
    select(*_SHOWN, shown_actor_column(_VERDICT.c.actor, _VERDICT.c.at).label("actor"))
    .where(
        _VERDICT.c.id.in_(
            select(func.max(_VERDICT.c.id))
            .where(_VERDICT.c.group_id.in_(bindparam("ids", expanding=True)))
            .group_by(_VERDICT.c.group_id, _VERDICT.c.actor)
        )
    )
    .order_by(_VERDICT.c.id.desc())
)


def read_verdicts(session: Session, group_ids: Sequence[int]) -> dict[int, list[StoredVerdict]]:
    """All verdicts of groups, the newest first; groups without one are left out."""
    return _verdicts_by_group(session.execute(_OF_GROUPS, {"ids": list(group_ids)}))


def read_last_verdicts(
    session: Session, group_ids: Sequence[int]
) -> dict[int, list[StoredVerdict]]:
    """Like ``read_verdicts``, but of each person the last alone, under the name that is shown."""
    return _verdicts_by_group(session.execute(_LAST_OF_EACH, {"ids": list(group_ids)}))


def _verdicts_by_group(rows: Iterable[Any]) -> dict[int, list[StoredVerdict]]:
    verdicts: dict[int, list[StoredVerdict]] = {}
    for row in rows:
        verdicts.setdefault(row.group_id, []).append(StoredVerdict(**row._mapping))
    return verdicts


def list_groups_of_verdict_range(session: Session, first: int, last: int) -> list[int]:
    """Ids of the groups that the verdicts of a range of ids judge."""
    statement = select(VerdictModel.group_id).where(VerdictModel.id.between(first, last))
    return list(session.scalars(statement.order_by(VerdictModel.id)))


def list_groups_with_newest_verdict_in_range(session: Session, first: int, last: int) -> list[int]:
    """Ids of the groups whose newest verdict is one of a range of ids."""
    judged = select(VerdictModel.group_id).where(VerdictModel.id.between(first, last))
    newest = func.max(VerdictModel.id)
    statement = (
        select(VerdictModel.group_id)
        .where(VerdictModel.group_id.in_(judged))
        .group_by(VerdictModel.group_id)
        .having(newest.between(first, last))
    )
    return list(session.scalars(statement))


def read_judged_inputs_hashes(
    session: Session, first: int, last: int, group_ids: Sequence[int]
) -> dict[int, str]:
    """Inputs hash that the verdicts of a range of ids judged, by the group's id."""
    statement = select(VerdictModel.group_id, VerdictModel.inputs_hash).where(
        VerdictModel.id.between(first, last), VerdictModel.group_id.in_(group_ids)
    )
    return {row.group_id: row.inputs_hash for row in session.execute(statement)}


class JudgeCount(NamedTuple):
    """When a person judged last, and how many groups since some time."""

    actor: str
    last: str
    groups: int


def count_groups_by_judge(session: Session, dataset_id: int, since: str) -> Sequence[JudgeCount]:
    """Everybody who judged a group of a dataset, with the groups that they judged since some time."""
    recent = case((VerdictModel.at >= since, VerdictModel.group_id))
    actor = shown_actor_column(VerdictModel.actor, VerdictModel.at)
    statement = (
        select(
            actor.label("actor"),
            func.max(VerdictModel.at).label("last"),
            func.count(recent.distinct()).label("groups"),
        )
        .join(GroupModel, GroupModel.id == VerdictModel.group_id)
        .where(
            GroupModel.dataset_id == dataset_id,
            *visible_groups_condition(dataset_id, GroupModel.id),
        )
        .group_by(actor)
    )
    return session.rows(JudgeCount, statement)


def find_next_verdict_id(session: Session) -> int:
    """The id that the next verdict gets."""
    return find_next_row_id(session, VerdictModel)


def insert_verdicts_and_end_work(
    session: Session, dataset_id: int, given: Sequence[StoredVerdict], *, actor: str, at: str
) -> None:
    """Insert verdicts on groups of a dataset, and log them under who gives them; work on these groups
    that was given out is over by that, and a copy is submitted.

    Raises:
        ForbiddenError: A group is somebody else's copy.
        ConflictError: A group is a copy that was submitted.
    """
    rows = [dict(vars(verdict)) for verdict in given]
    session.execute(insert(_VERDICT), rows)
    entries = []
    for row in rows:
        body = {name: value for name, value in row.items() if name not in ("id", "group_id")}
        entries.append(NewLogEntry("verdict", actor, at, body, dataset_id, row["group_id"]))
    append_entries(session, entries)
    if dataset_id <= COPIES:
        states = {verdict.group_id: verdict.state for verdict in given}
        complete_judged_groups(session, states, actor=actor, at=at)
        return
    for row in rows:
        submit_copy_on_verdict(session, row["group_id"], row["state"], actor=actor, at=at)


def find_newest_verdict_id(session: Session) -> int:
    """Id of the last verdict of any group; 0 where there is none."""
    return session.scalar(select(func.max(VerdictModel.id))) or 0


def list_groups_judged_after_verdict(session: Session, dataset_id: int, after: int) -> list[int]:
    """Ids of the groups of a dataset that somebody judged after a verdict, or took that back."""
    statement = (
        select(VerdictModel.group_id)
        .join(GroupModel, GroupModel.id == VerdictModel.group_id)
        .where(GroupModel.dataset_id == dataset_id, VerdictModel.id > after)
    )
    return list(session.scalars(statement))


Spans = Sequence[tuple[int, int]]
"""First and last id of the verdicts of each chunk."""

_BATCHES = select(*VerdictBatchModel.__table__.columns)
_SPANS = ("spans", "undo_spans")


@dataclass(frozen=True)
class StoredBulkVerdict:
    """A bulk verdict as it is remembered.

    Attributes:
        log_id: The entry that closed it; None while it runs, or when it was killed.
        undone: When it was taken back; ``redone`` is the batch that gave it again after that.
        undo_spans: Of the verdicts that took it back; None where that is not known.
    """

    id: int
    dataset_id: int
    actor: str
    at: str
    query: str
    state: str
    reason: str | None
    note: str | None
    changed: int
    spans: Spans
    log_id: int | None
    undone: str | None
    undone_by: str | None
    undo_spans: Spans | None
    redone: int | None

    @property
    def done(self) -> bool:
        """False while it runs, or when it was killed."""
        return self.log_id is not None

    @property
    def is_taken_back(self) -> bool:
        """Whether its verdicts have been taken back, or are being."""
        return self.undone is not None or self.undo_spans is not None


def read_bulk_verdicts(
    session: Session, dataset_id: int, limit: int, before: int | None = None
) -> list[StoredBulkVerdict]:
    """The batches of a dataset, the newest first; only those before an id where there is one."""
    model = VerdictBatchModel
    statement = _BATCHES.where(model.dataset_id == dataset_id).order_by(model.id.desc())
    if before is not None:
        statement = statement.where(model.id < before)
    return [_batch_from_row(row) for row in session.execute(statement.limit(limit))]


def find_bulk_verdict(session: Session, batch_id: int) -> StoredBulkVerdict | None:
    """A batch by its id."""
    row = session.execute(_BATCHES.where(VerdictBatchModel.id == batch_id)).one_or_none()
    return None if row is None else _batch_from_row(row)


def insert_bulk_verdict(session: Session, **values: Any) -> int:
    """Insert a batch, from fields of ``StoredBulkVerdict`` but its id; returns its id."""
    identity = find_next_row_id(session, VerdictBatchModel)
    session.execute(insert(VerdictBatchModel), [{**_batch_columns(values), "id": identity}])
    return identity


def update_bulk_verdict(session: Session, batch_id: int, **values: Any) -> None:
    """Change fields of a batch."""
    mine = VerdictBatchModel.id == batch_id
    session.execute(update(VerdictBatchModel).where(mine).values(_batch_columns(values)))


def _batch_from_row(row: Any) -> StoredBulkVerdict:
    spans = {name: parse_json_column(getattr(row, name) or "null") for name in _SPANS}
    return StoredBulkVerdict(**{**row._mapping, **spans})


def _batch_columns(values: dict[str, Any]) -> dict[str, Any]:
    return {name: json_text(item) if name in _SPANS else item for name, item in values.items()}


def append_span(spans: Spans, ids: Sequence[int]) -> Spans:
    """Spans together with that of some ids in a row, which often go on where the last one ends."""
    if not ids:
        return spans
    first, last = ids[0], ids[-1]
    if spans and spans[-1][1] + 1 == first:
        return [*spans[:-1], (spans[-1][0], last)]
    return [*spans, (first, last)]


def split_spans(spans: Spans, most: int) -> list[tuple[int, int]]:
    """The same ids in spans of at most so many."""
    return [
        (start, min(start + most - 1, last))
        for first, last in spans
        for start in range(first, last + 1, most)
    ]


def is_group_mended(verdict: Any, edited: bool, passes: bool | None) -> bool:
    """Whether a group was mended: edited, accepted as such, and not failing as it is now.

    What was edited when the verdict was given may have been undone since; a group that was
    accepted against a gate, or rejected, was not mended.

    Args:
        verdict: With ``state``, ``override`` and ``fixed`` as they were given.
        edited: Whether the group differs from what its dataset brought, now.
        passes: What the gates say now; None while that is not known.
    """
    accepted = verdict.state == "accepted" and verdict.override is None
    return bool(verdict.fixed and accepted and edited and passes is not False)
