"""Handed back: why a group waits again for somebody who had handed it in, as the log says it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.soccer.actors import person_of
from app.store.listing import read_columns
from app.store.log import read_entries_of
from app.store.session import Session
from app.store.submissions import RETURNED

_KINDS = ("work", "take")
"""Kinds of such entries: about groups of batches, and about own annotations."""


@dataclass(frozen=True)
class HandedBack:
    """A group that was handed back: by whom, when, and why; the reason may be empty."""

    group: int
    title: str
    by: str
    at: str
    reason: str


def read_handed_back(session: Session, group_ids: Sequence[int]) -> dict[int, HandedBack]:
    """How groups were handed back last, by their ids; the caller knows that they wait again."""
    last = {
        entry.group_id: entry
        for entry in read_entries_of(session, group_ids, _KINDS)
        if entry.group_id is not None and entry.body.get("did") == RETURNED
    }
    names = {
        row.group_id: row.label or row.key
        for row in read_columns(session, list(last), (), ("group_id", "label", "key"))
    }
    return {
        group: HandedBack(
            group, names.get(group, ""), person_of(entry.actor), entry.at, entry.body["reason"]
        )
        for group, entry in last.items()
    }
