"""Reviewers: who has judged how much of a dataset."""

from __future__ import annotations

from dataclasses import dataclass

from app.store.clock import now
from app.store.listing import count_reviewed
from app.store.store import Store
from app.store.verdicts import count_by_judge


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
    with store.read() as session:
        people = count_by_judge(session, dataset_id, since=now()[:10])
        counts = count_reviewed(session, dataset_id)
    reviewers = [
        Reviewer(
            name=row.actor,
            today=row.groups,
            last=row.last,
            **{
                status: counts.get((row.actor, status), 0)
                for status in ("accepted", "rejected", "deferred")
            },
        )
        for row in people
    ]
    return sorted(
        reviewers, key=lambda item: (-item.accepted - item.rejected - item.deferred, item.name)
    )
