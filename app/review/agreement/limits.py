"""Limits: how far annotations of a dataset's groups may lie apart and still agree."""

from __future__ import annotations

from dataclasses import asdict

from app.evaluation.agreement_limits import AgreementLimits
from app.review.datasets.dataset import dataset_id
from app.store.agreement import limits_of, put_limits
from app.store.clock import now
from app.store.log import Entry, append
from app.store.session import Session
from app.store.store import Store

KIND = "agreement"
"""Kind of the log's entries about agreement; they change no group."""


def read_limits(session: Session, dataset: int) -> AgreementLimits:
    """The limits of a dataset, by its id; the defaults where nobody has set any."""
    row = limits_of(session, dataset)
    return AgreementLimits() if row is None else AgreementLimits(**row._mapping)


def set_limits(
    store: Store, dataset: str | int, limits: AgreementLimits, *, actor: str
) -> AgreementLimits:
    """Let other limits count for whatever is handed in from now on."""
    number, at = dataset_id(store, dataset), now()
    with store.write() as session:
        put_limits(session, number, {**asdict(limits), "changed": at, "changed_by": actor})
        append(session, [Entry(KIND, actor, at, {"did": "limits", **asdict(limits)}, number)])
        session.respond(limits)
    return limits
