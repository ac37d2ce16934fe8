"""Copies: a person's own annotation of a group is closed once it is handed in."""

from __future__ import annotations

from app.errors import ConflictError
from app.store.session import Session
from app.store.sight import COPIES
from app.store.takes import take_of_copy


def require_open(session: Session, dataset_id: int, group_id: int) -> None:
    """Raise ConflictError where a group is an own annotation that was handed in."""
    take = take_of_copy(session, group_id) if dataset_id > COPIES else None
    if take is not None and take.handed_in is not None:
        raise ConflictError(
            "this annotation is submitted and can no longer be changed",
            hint="Withdraw your verdict to continue, or ask a lead.",
        )


def require_unsettled(session: Session, dataset_id: int, group_id: int) -> None:
    """Raise ConflictError where a group is an own annotation that somebody has decided about."""
    take = take_of_copy(session, group_id) if dataset_id > COPIES else None
    if take is not None and take.settled is not None:
        raise ConflictError("this annotation was adjudicated already; its verdict stays as it is")
