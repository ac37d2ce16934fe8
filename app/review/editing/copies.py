"""Copies: an independent annotation of a group is closed once it is submitted."""

from __future__ import annotations

from app.store import submissions
from app.store.session import Session
from app.store.sight import COPIES
from app.store.takes import take_of_copy


def require_open(session: Session, dataset_id: int, group_id: int) -> None:
    """Raise ConflictError where a group is an independent annotation that was submitted."""
    if dataset_id > COPIES:
        submissions.require_open(take_of_copy(session, group_id))
