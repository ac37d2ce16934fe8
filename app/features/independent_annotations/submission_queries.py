"""Submissions: the one rule by which a person's copy of a group is submitted, judged and returned.

Nothing else writes when a copy was submitted. Every submission and every return is a log entry, and
a submission's entry holds the annotation as it was then: what is measured is the first one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries, iterate_group_entries_of_kinds
from app.db.session import Session
from app.errors import ConflictError, ForbiddenError
from app.features.agreement.queries import delete_open_agreement
from app.features.groups.queries import read_groups
from app.features.independent_annotations.queries import (
    IndependentAnnotation,
    find_annotation_of_copy,
    update_annotation,
)
from app.soccer.actors import LOCAL_USER, person_of_actor
from app.soccer.codec import group_to_json

KIND = "take"
"""Kind of the log's entries about what became of a copy."""
SUBMITTED = "handed in"
RETURNED = "handed back"
"""What such an entry says was done."""
_ONLY_LEADS = "Only a lead can return it, and says why."


def require_annotation_open(annotation: IndependentAnnotation | None) -> None:
    """Raise ConflictError where a copy was submitted; ``None`` is an ordinary group.

    Whether it was adjudicated since the sentence does not say: copies of gold groups never are.
    """
    if annotation is not None and (
        annotation.submitted is not None or annotation.settled is not None
    ):
        raise ConflictError(
            "this annotation was submitted, and can no longer be changed", hint=_ONLY_LEADS
        )


def _require_own_annotation(annotation: IndependentAnnotation, actor: str) -> None:
    """Raise ForbiddenError where a copy is somebody else's."""
    # On a server without accounts everybody is the local user.
    if person_of_actor(actor) not in (annotation.person, LOCAL_USER):
        raise ForbiddenError(f"only {annotation.person} can submit and judge this annotation")


def submit_copy(
    session: Session,
    annotation: IndependentAnnotation,
    *,
    actor: str,
    at: str,
    verdict: str | None = None,
) -> None:
    """Submit a copy, with its person's verdict where they judged it.

    Raises:
        ForbiddenError: It is somebody else's.
        ConflictError: It was submitted already.
    """
    _require_own_annotation(annotation, actor)
    require_annotation_open(annotation)
    (stored,) = read_groups(session, [annotation.copy_id]).values()
    # Of a copy that was returned the verdict stays, unless its person gives another one.
    verdict = verdict or annotation.verdict
    update_annotation(session, annotation.id, submitted=at, verdict=verdict)
    body: dict[str, Json] = {
        "take": annotation.id,
        "person": annotation.person,
        "did": SUBMITTED,
        "verdict": verdict,
        "inputs_hash": stored.inputs_hash,
        "submitted": group_to_json(stored.group),
    }
    append_entries(session, [NewLogEntry(KIND, actor, at, body, stored.dataset_id, stored.id)])


def submit_copy_on_verdict(
    session: Session, copy_id: int, state: str, *, actor: str, at: str
) -> None:
    """A verdict on a copy submits it; on an ordinary group nothing comes of it.

    Raises:
        ForbiddenError: It is somebody else's.
        ConflictError: It was submitted already: its verdict stays, too.
    """
    annotation = find_annotation_of_copy(session, copy_id)
    if annotation is None:
        return
    if state != "unreviewed":
        submit_copy(session, annotation, actor=actor, at=at, verdict=state)
    else:
        _require_own_annotation(annotation, actor)
        require_annotation_open(annotation)
        update_annotation(session, annotation.id, verdict=None)


def reopen_copy(session: Session, annotation: IndependentAnnotation) -> None:
    """Let the person of a submitted copy go on with it; the caller logs who returned it, and why.

    What was compared with it waits for no decision any more.

    Raises:
        ConflictError: It is not submitted, or it was decided about.
    """
    if annotation.settled is not None:
        raise ConflictError("this annotation was adjudicated already")
    if annotation.submitted is None:
        raise ConflictError(f"{annotation.person} has not submitted this yet")
    update_annotation(session, annotation.id, submitted=None)
    delete_open_agreement(session, annotation.group_id, annotation.batch_id or 0)


def list_submissions(
    session: Session, copy_ids: Sequence[int]
) -> Mapping[int, list[Mapping[str, Any]]]:
    """The bodies of the entries about submissions of copies, the first one first.

    Copies that were submitted before there were such entries have none.
    """
    found: dict[int, list[Mapping[str, Any]]] = {}
    for entry in iterate_group_entries_of_kinds(session, copy_ids, (KIND,)):
        if entry.group_id is not None and entry.body.get("did") == SUBMITTED:
            found.setdefault(entry.group_id, []).append({"at": entry.at, **entry.body})
    return found
