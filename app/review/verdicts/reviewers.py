"""Reviewers: who has judged how much of a dataset."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import case, func, select

from app.store.clock import now
from app.store.models import GroupModel, QueueModel, VerdictModel
from app.store.session import Store


@dataclass(frozen=True)
class Reviewer:
    """One person's verdicts.

    Attributes:
        accepted: Groups whose verdict counts and is this person's, like ``rejected`` and
            ``deferred``.
        today: Groups that this person has judged since midnight UTC.
        last: Time of this person's last verdict.
    """

    name: str
    accepted: int
    rejected: int
    deferred: int
    today: int
    last: str


def list_reviewers(store: Store, dataset_id: int) -> list[Reviewer]:
    """Everybody who has judged a group of a dataset, the most active first."""
    today = now()[:10]
    given = (
        select(
            VerdictModel.actor,
            func.max(VerdictModel.at),
            func.count(case((VerdictModel.at >= today, VerdictModel.group_id)).distinct()),
        )
        .join(GroupModel, GroupModel.id == VerdictModel.group_id)
        .where(GroupModel.dataset_id == dataset_id)
        .group_by(VerdictModel.actor)
    )
    counting = (
        select(QueueModel.reviewer, QueueModel.status, func.count())
        .where(QueueModel.dataset_id == dataset_id, QueueModel.reviewer.is_not(None))
        .group_by(QueueModel.reviewer, QueueModel.status)
    )
    with store.read() as session:
        people = session.execute(given).all()
        counts = {(name, status): count for name, status, count in session.execute(counting)}
    reviewers = [
        Reviewer(
            name=name,
            today=judged,
            last=last,
            **{
                status: counts.get((name, status), 0)
                for status in ("accepted", "rejected", "deferred")
            },
        )
        for name, last, judged in people
    ]
    return sorted(
        reviewers, key=lambda item: (-item.accepted - item.rejected - item.deferred, item.name)
    )
