"""Whether what annotators are told is what somebody wrote, by the log's digests."""

from __future__ import annotations

import hashlib

from app.review.doctor.check import Check, as_logged
from app.review.doctor.people import DELETED
from app.store.guidelines import GUIDELINE, all_guidelines
from app.store.log import entries_of_kinds
from app.store.session import Session


def examine_guidelines(session: Session, restore: str) -> Check:
    """Compare every version of every dataset's guidelines with the digest in the log.

    Args:
        session: A read session on a log whose chain is whole.
        restore: What to do where a text is not what was written.
    """
    said = _said(session)
    present = {
        (row.dataset_id, row.number): hashlib.sha256(row.text.encode()).hexdigest()
        for row in all_guidelines(session)
    }
    return as_logged("guidelines", said, present, restore, _name)


def _name(key: tuple[int, int]) -> str:
    dataset, number = key
    return f"version {number} of dataset {dataset}"


def _said(session: Session) -> dict[tuple[int, int], str]:
    said: dict[tuple[int, int], str] = {}
    for entry in entries_of_kinds(session, [GUIDELINE, DELETED]):
        assert entry.dataset_id is not None
        if entry.kind == DELETED:
            said = {key: digest for key, digest in said.items() if key[0] != entry.dataset_id}
        else:
            said[entry.dataset_id, entry.body["number"]] = entry.body["digest"]
    return said
