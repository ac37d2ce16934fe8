"""Settling: notes that work on groups is done or waits again, and which batches are done by that."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from sqlalchemy import bindparam, delete, exists, func, select, update

from app.db.dialects.dialect import select_from_number_list, select_from_number_parameter
from app.db.session import Session
from app.features.batches.queries import OPEN
from app.features.batches.tables import BatchGroupModel, BatchModel, LeaseModel
from app.features.verdicts.tables import VerdictModel
from app.features.webhooks.queries import DONE, queue_messages_about_batch
from app.features.webhooks.tables import WebhookModel
from app.json_text import json_text

_OVER = ("accepted", "rejected")
"""Verdicts after which a group waits for nobody."""
_BATCH = BatchModel.__table__
_IS_SINGLE = (_BATCH.c.state == OPEN, _BATCH.c.verdicts == 1)
_TELLS = exists().where(WebhookModel.dataset_id == _BATCH.c.dataset_id, WebhookModel.off.is_(None))
"""The dataset of the batch has an active webhook."""
# What every verdict asks is put together once: that takes longer than to answer it.
_GIVEN = BatchGroupModel.group_id.in_(select_from_number_parameter("ids"))
_IN_BATCH = exists().where(BatchGroupModel.batch_id == _BATCH.c.id, _GIVEN)
_TOUCHED = select(
    _BATCH.c.id, (_TELLS & _IN_BATCH.where(BatchGroupModel.settled.is_(None))).label("is_near")
).where(*_IS_SINGLE, _IN_BATCH)
"""Open batches that ask for one verdict and have some of the groups; whether somebody is to be told if
they are done by that."""
_SINGLE = select(_BATCH.c.id).where(*_IS_SINGLE)
_SETTLE = (
    update(BatchGroupModel)
    .where(_GIVEN, BatchGroupModel.batch_id.in_(_SINGLE))
    .values(settled=bindparam("over"))
)
_CLOSE = delete(LeaseModel).where(
    LeaseModel.group_id.in_(select_from_number_parameter("ids")), LeaseModel.batch_id.in_(_SINGLE)
)


def complete_judged_groups(
    session: Session, states: Mapping[int, str], *, actor: str, at: str
) -> None:
    """Groups were judged: in open batches that ask for one verdict their work is over.

    A group that is deferred, or not judged any more, waits again. Whoever has a settled group open
    needs it no longer.

    Args:
        session: The write session that holds the verdicts.
        states: The verdict on each group.
        actor: Who gave them.
        at: When they were given.
    """
    over = {group for group, state in states.items() if state in _OVER}
    for ids, settled in ((over, at), (set(states) - over, None)):
        given = {"ids": json_text(sorted(ids))}
        touched = session.execute(_TOUCHED, given).all() if ids else []
        if not touched:
            continue
        session.execute(_SETTLE, {**given, "over": settled})
        if settled is not None:
            session.execute(_CLOSE, given)
            near = [row.id for row in touched if row.is_near]
            _announce_finished_batches(session, near, actor=actor, at=at)


def follow_verdicts_given_while_closed(session: Session, batch_id: int, since: str) -> None:
    """Bring the groups of a batch that asks for one verdict up to the verdicts that they have.

    Args:
        session: The write session that opens the batch again.
        batch_id: The batch.
        since: When it was made: earlier verdicts do not count in it.
    """
    mine, verdict = BatchGroupModel.batch_id == batch_id, VerdictModel
    newest = (
        select(func.max(verdict.id))
        .where(verdict.group_id.in_(select(BatchGroupModel.group_id).where(mine)))
        .group_by(verdict.group_id)
    )
    judged = select(verdict.group_id, verdict.at).where(
        verdict.id.in_(newest), verdict.state.in_(_OVER)
    )
    rows = session.execute(judged).all()
    ids = select_from_number_list(row.group_id for row in rows)
    back = update(BatchGroupModel).where(mine, BatchGroupModel.group_id.not_in(ids))
    session.execute(back.values(settled=None))
    waits = (mine, BatchGroupModel.settled.is_(None))
    for row in rows:
        if row.at >= since:
            done = update(BatchGroupModel).where(*waits, BatchGroupModel.group_id == row.group_id)
            session.execute(done.values(settled=row.at))


def complete_group_in_batch(
    session: Session, batch_id: int, group_id: int, *, actor: str, at: str
) -> None:
    """The work on a group of a batch is over."""
    mine = (BatchGroupModel.batch_id == batch_id, BatchGroupModel.group_id == group_id)
    waits = (*mine, BatchGroupModel.settled.is_(None))
    nearly_done = select(_BATCH.c.id).where(_BATCH.c.id == batch_id, _TELLS, exists().where(*waits))
    near = list(session.scalars(nearly_done))
    session.execute(update(BatchGroupModel).where(*waits).values(settled=at))
    _announce_finished_batches(session, near, actor=actor, at=at)


def reopen_group_in_batch(session: Session, batch_id: int, group_id: int) -> None:
    """The work on a group of a batch goes on."""
    mine = (BatchGroupModel.batch_id == batch_id, BatchGroupModel.group_id == group_id)
    session.execute(update(BatchGroupModel).where(*mine).values(settled=None))


def _announce_finished_batches(
    session: Session, batch_ids: Collection[int], *, actor: str, at: str
) -> None:
    """Tell of those of some batches in which no group waits any more."""
    if not batch_ids:
        return
    waits = select(BatchGroupModel.batch_id).where(
        BatchGroupModel.batch_id.in_(batch_ids), BatchGroupModel.settled.is_(None)
    )
    for batch_id in sorted(set(batch_ids) - set(session.scalars(waits.distinct()))):
        queue_messages_about_batch(session, batch_id, DONE, actor=actor, at=at)
