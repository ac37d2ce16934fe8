"""Deleting a dataset: everything that belongs to it goes, the log stays and says so.

See docs/decisions/0008-deleting-a-dataset.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from app.errors import ConflictError
from app.review.datasets.dataset import dataset_id, insert_dataset, read_dataset_head
from app.review.datasets.spare_calibrations import delete_spare_calibrations
from app.review.idempotency import without_response
from app.soccer.policy import Policy
from app.store import removal
from app.store.clock import now
from app.store.copy_datasets import copies_of
from app.store.log import Entry, append
from app.store.session import Session
from app.store.store import Store

KIND = "dataset_deleted"
CHUNK = 500
"""Solutions a transaction."""


@dataclass(frozen=True)
class DatasetContents:
    """What belongs to a dataset; ``counts`` by groups, views, verdicts, versions and so on."""

    id: int
    name: str
    counts: dict[str, int]


def read_contents(store: Store, dataset: str | int) -> DatasetContents:
    """What deleting a dataset would take away.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _contents(session, read_dataset_head(session, dataset).id)


def delete_dataset(
    store: Store, dataset: str | int, *, confirm: str, actor: str, afresh: Policy | None = None
) -> DatasetContents:
    """Delete a dataset with everything that belongs to it; returns what that was.

    What was computed goes first, in short transactions: killed in between, it is computed again.
    What was said goes at the end, all at once. The log keeps every entry and gains one.

    Args:
        store: The database.
        dataset: Name or id.
        confirm: The name, once more.
        actor: Who wants it.
        afresh: Policy of an empty dataset of the same name, which is made in its place with its
            roles, tokens and webhooks; None: none is.

    Raises:
        NotFoundError: There is no such dataset.
        ConflictError: ``confirm`` is another name; nothing is deleted.
    """
    found = read_contents(store, dataset)
    if confirm != found.name:
        raise ConflictError(
            f'the dataset is called "{found.name}"',
            hint="Send its name as confirm: deleting cannot be undone.",
            pointer="/confirm",
        )
    identity = dataset_id(store, found.id)
    with store.read() as session:
        copies = copies_of(session, identity)
    with without_response():
        for row in copies:
            delete_dataset(store, row.dataset_id, confirm=row.name, actor=actor)
    _delete_solutions(store, identity)
    with store.write() as session:
        contents = _contents(session, identity)
        removal.keep_used_ids(session)
        heir = None if afresh is None else removal.move_access(session, identity)
        body = {"name": contents.name, "counts": contents.counts, "heir": heir}
        append(session, [Entry(KIND, actor, now(), body, identity)])
        removal.delete_rows(session, identity)
        if afresh is not None:
            assert insert_dataset(session, contents.name, afresh, actor) == heir
        session.respond(contents)
    delete_spare_calibrations(store)
    return contents


def _contents(session: Session, identity: int) -> DatasetContents:
    name = read_dataset_head(session, identity).name
    return DatasetContents(identity, name, removal.count_contents(session, identity))


def _delete_solutions(store: Store, identity: int) -> None:
    """Delete what was computed."""
    with store.read() as session:
        solutions = removal.solutions_of(session, identity)
    for start in range(0, len(solutions), CHUNK):
        with store.write() as session:
            removal.delete_solutions(session, solutions[start : start + CHUNK])
