"""Policies in the database: every one that judged a dataset, out of the log."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select, text

from app.db.json_columns import decompress_json
from app.db.log import LogModel
from app.db.session import Session
from app.features.people.visibility_queries import shown_actor_column
from app.soccer.codec import policy_from_json
from app.soccer.policy import Policy


@dataclass(frozen=True)
class PolicyVersion:
    """A policy that judged a dataset from some time on."""

    version: int
    at: str
    actor: str
    policy: Policy


# Word for word the condition of the index, which holds a few of a million entries.
_JUDGED = text("kind IN ('dataset', 'policy')")


def read_policy_history(session: Session, dataset_id: int) -> tuple[PolicyVersion, ...]:
    """The policies of a dataset, oldest first."""
    statement = (
        select(
            LogModel.at,
            shown_actor_column(LogModel.actor, LogModel.at).label("actor"),
            LogModel.body,
        )
        .where(LogModel.dataset_id == dataset_id, _JUDGED)
        .order_by(LogModel.id)
    )
    return tuple(
        PolicyVersion(
            number, row.at, row.actor, policy_from_json(decompress_json(row.body)["policy"])
        )
        for number, row in enumerate(session.execute(statement), 1)
    )


def find_policy_change_time(session: Session, dataset_id: int) -> str | None:
    """When the policy of a dataset became what it is; None where the log does not say."""
    statement = (
        select(LogModel.at)
        .where(LogModel.dataset_id == dataset_id, _JUDGED)
        .order_by(LogModel.id.desc())
        .limit(1)
    )
    return session.scalar(statement)
